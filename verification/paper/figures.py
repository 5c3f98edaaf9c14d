#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""The paper's solids with remeshing, as far as they go: pictures at the times of its figures, and what remeshing gains a step (Fig. 9).

python3 verification/paper/figures.py [--only NAME]... [--draw] [--itr build/release/bin/itr] [--shared ../shared] [--runs results/figures]

A run goes on where an earlier one was stopped, and is stopped itself after its hours. Each leaves NAME/README.md, pictures and steps.csv
here; --draw runs nothing.
"""
import argparse
import bisect
import csv
import dataclasses
import json
import os
import pathlib
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE.parent))
from harness import stored  # noqa: E402


@dataclasses.dataclass
class Scene:
    file: str
    figure: str                 # of the paper
    table: str                  # its Table 1: seconds a step, unknowns (most), GiB
    times: list                 # [s] of the panels
    view: str
    cut: str | None = None      # "x,y,z,d" of a second picture
    zoom: float = 1.0
    sets: tuple = ()
    hours: float = 0.25


SCENES = {
    "ball-wall-3d": Scene("ball-wall/3D.json", "Figs. 8 and 9", "960.8 s a step, 50k (61k) unknowns, 2.9 GiB",
                          [0.0, 0.00134, 0.0015, 0.0018, 0.0034, 0.012], "-0.5,0.25,1", "0,0,1,0", 0.85),
    "masticator-3d": Scene("masticator/3D.json", "Fig. 3", "8 230.8 s a step, 16k (57k) unknowns, 4.1 GiB",
                           [0.0, 2.5, 5.0, 7.5, 10.0], "0.4,0.3,1"),
    "twisting-beam-3d": Scene("twisting-beam/twisting-beam.json", "Fig. 6", "2 234.9 s a step, 24k (78k) unknowns, 3.7 GiB",
                              [0.0, 0.5, 1.0, 2.0, 3.0], "0.3,0.3,1",
                              sets=("/space/remesh/split/acceptance_tolerance=10",)),
    "spikes3d": Scene("spikes3d/drop-ball.json", "Fig. 1", "12 316.6 s a step, 43k (55k) unknowns, 2.0 GiB",
                      [0.0, 0.35, 0.45, 0.6, 5.0], "0.4,0.5,1"),
    "rollers": Scene("rollers/monkey-soft-hard.json", "Fig. 4", "1 077.8 s a step, 22k (27k) unknowns, 7.7 GiB",
                     [0.0, 0.1, 0.5, 1.9, 3.8], "0.2,0.3,1"),
}
COLUMNS = ("step", "t", "vertices", "unknowns", "newton_iterations", "splits", "collapses", "swaps", "smooths", "gain", "energy",
           "min_distance", "processor_seconds", "peak_rss_mb")


def run(name, options):
    """Whether it went to its end; stopped after its hours as a user would stop it, so that all that is done stays."""
    scene, results = SCENES[name], options.runs / name
    path = os.path.relpath(options.shared / "paper-scenes/scripts" / scene.file, ROOT)
    command = [str(options.itr), "run", path, "-o", str(results), "--threads", "1", "--defaults", "polyfem"]
    command += [word for setting in scene.sets for word in ("--set", setting)]
    if (results / "steps.jsonl").exists():
        command.append("--resume")
    process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL)
    try:
        return process.wait(timeout=3600 * scene.hours) == 0
    except subprocess.TimeoutExpired:
        process.terminate()
        process.wait()
        return False


def note_commit(results):
    """Which sources make the steps from the next one on; a run may go on with others than it began with."""
    steps = results / "steps.jsonl"
    first = sum(1 for _ in open(steps)) if steps.exists() else 0
    results.mkdir(parents=True, exist_ok=True)
    with open(results / "commits", "a") as file:
        file.write(f"{first} {stored.made(f'verification/paper/{results.name}/steps.csv')}\n")


def commits_of(results):
    """Pairs of a first step and what made the steps from there on."""
    noted = dict(line.split(" ", 1) for line in (results / "commits").read_text().splitlines())
    pairs = sorted((int(first), made) for first, made in noted.items())
    return [pair for before, pair in zip([(None, None), *pairs], pairs) if pair[1] != before[1]]


def in_words(commits):
    first, *others = [(step, made.partition(" ")[0]) for step, made in commits]
    return ", ".join([first[1], *(f"from step {step} on {commit}" for step, commit in others)])


def steps_of(results):
    """A row a step. The gain is the paper's -dE: from the end of the first solve to the end of the last, on its mesh [J]."""
    rows = []
    with open(results / "steps.jsonl") as file:
        for step in map(json.loads, file):
            before = step.get("energy_before_remesh")
            total = step["energy"]["total"]
            counts = {kind: step.get(kind, {}).get("accepted", 0) for kind in ("splits", "collapses", "swaps", "smooths")}
            rows.append({**{key: step.get(key) for key in COLUMNS}, **counts, "energy": total,
                         "gain": before - total if before is not None and any(counts.values()) else 0.0})
    return rows


def draw_effectiveness(rows, path):
    import matplotlib
    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    figure, bars = plt.subplots(figsize=(9, 3.2), layout="constrained")
    line = bars.twinx()
    t = [row["t"] for row in rows]
    width = (t[-1] - t[0]) / max(1, len(t) - 1)
    bars.bar(t, [row["splits"] for row in rows], width, color="tab:green", label="splits")
    bars.bar(t, [-row["collapses"] for row in rows], width, color="tab:orange", label="collapses")
    line.plot(t, [row["gain"] for row in rows], color="tab:blue", linewidth=1, label="gain")
    line.set_yscale("symlog", linthresh=max(1e-300, 1e-4 * max((abs(row["gain"]) for row in rows), default=1) or 1))
    bars.set_xlabel("t [s]")
    bars.set_ylabel("accepted a step")
    line.set_ylabel("energy gained a step [J]")
    handles = [h for axes in (bars, line) for h in axes.get_legend_handles_labels()[0]]
    bars.legend(handles, ["splits", "collapses (down)", "gain"], loc="upper right", fontsize=8)
    figure.savefig(path, metadata={"Date": None})
    plt.close(figure)


def draw(name, options, rows):
    """Pictures at the stored steps nearest to the times that were reached."""
    scene, results = SCENES[name], options.runs / name
    stored_steps = sorted(int(path.stem) for path in (results / "frames").glob("*.h5"))
    times = {row["step"]: row["t"] for row in rows}
    t = [times[step] for step in stored_steps if step in times]
    chosen = []
    for time in [*scene.times, t[-1]]:
        if time <= t[-1] * (1 + 1e-9):
            at = min(bisect.bisect_left(t, time * (1 - 1e-9)), len(t) - 1)
            chosen.append(stored_steps[at])
    chosen = sorted(set(chosen))
    common = ["/usr/bin/python3", str(ROOT / "examples/render.py"), str(results), "--frames", ",".join(map(str, chosen)), f"--view={scene.view}",
              "--zoom", str(scene.zoom)]
    subprocess.run([*common, "-o", str(HERE / name / "bodies.png")], check=True)
    if scene.cut:
        subprocess.run([*common, f"--cut={scene.cut}", "-o", str(HERE / name / "cut.png")], check=True)
    return [(step, times[step]) for step in chosen]


def page(name, rows, panels, certified, commit):
    scene = SCENES[name]
    steps = rows[1:]
    sets = "".join(f" --set {setting}" for setting in scene.sets)
    total = sum(row["processor_seconds"] for row in steps)
    count = {kind: sum(row[kind] for row in rows) for kind in ("splits", "collapses", "swaps", "smooths")}
    distances = [row["min_distance"] for row in steps if row["min_distance"] is not None]
    positive = sum(row["gain"] for row in rows if row["gain"] > 0)
    negative = sum(row["gain"] for row in rows if row["gain"] < 0)
    lines = [
        f"# {scene.file} with remeshing ({scene.figure} of the paper)", "",
        f"    itr run ../shared/paper-scenes/scripts/{scene.file}{sets} -o results --threads 1", "",
        f"{len(steps)} steps to t = {rows[-1]['t']:.6g} s, every stored one {'certified' if certified else '**NOT CERTIFIED**'}; "
        f"{total:.0f} processor seconds, {total / len(steps):.3g} a step, {max(row['processor_seconds'] for row in steps):.3g} at most; "
        f"{max(row['peak_rss_mb'] for row in steps):.0f} MB; {sum(row['newton_iterations'] for row in steps)} iterations; "
        f"{sum(row['unknowns'] for row in steps) / len(steps):.0f} unknowns on average, {max(row['unknowns'] for row in steps)} at most; "
        f"{rows[0]['vertices']} vertices at the start, "
        f"{max(row['vertices'] for row in rows)} at most, {rows[-1]['vertices']} in the last step; "
        f"{count['splits']} splits, {count['collapses']} collapses, {count['swaps']} swaps, {count['smooths']} smooths"
        + (f"; smallest distance {min(distances):.2g} m" if distances else "") + f". Commit {commit}.", "",
        f"The paper's Table 1 has {scene.table}, over the whole scene and with its tolerance.", "",
        "Panels: " + ", ".join(f"step {step} (t = {t:.4g} s)" for step, t in panels) + ".", "", "![Bodies](bodies.png)", ""]
    if scene.cut:
        lines += ["Cut open:", "", "![Cut](cut.png)", ""]
    lines += ["What remeshing gains a step, from the end of the solve before it to the end of the one after, on the mesh after (Fig. 9):", "",
              "![Effectiveness](effectiveness.svg)", "",
              f"Gained {positive:.4g} J in all, in {sum(row['splits'] > 0 for row in rows)} steps that split; "
              f"given back {-negative:.3g} J in {sum(row['gain'] < 0 for row in rows)} steps whose collapses and projection cost more "
              "than their splits gained."]
    return "\n".join(lines) + "\n"


def publish(name, options):
    results = options.runs / name
    (HERE / name).mkdir(exist_ok=True)
    rows = steps_of(results)
    commits = commits_of(results)
    made = lambda row: next(one for first, one in reversed(commits) if row["step"] >= first)
    with open(HERE / name / "steps.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, [*COLUMNS, "commit"], lineterminator="\n")
        writer.writeheader()
        writer.writerows({**row, "commit": made(row)} for row in rows)
    certified = subprocess.run([str(options.itr), "certify", str(results)], stdout=subprocess.DEVNULL).returncode == 0
    draw_effectiveness(rows, HERE / name / "effectiveness.svg")
    panels = draw(name, options, rows)
    (HERE / name / "README.md").write_text(page(name, rows, panels, certified, in_words(commits)))
    return certified


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", choices=SCENES)
    parser.add_argument("--draw", action="store_true", help="run nothing")
    parser.add_argument("--itr", type=pathlib.Path, default=ROOT / "build/release/bin/itr")
    parser.add_argument("--shared", type=pathlib.Path, default=ROOT.parent / "shared")
    parser.add_argument("--runs", type=pathlib.Path, default=ROOT / "results/figures")
    options = parser.parse_args()
    failed = 0
    for name in options.only or SCENES:
        if not options.draw:
            note_commit(options.runs / name)
            done = run(name, options)
            print(f"{name}: {'to its end' if done else 'stopped'}", flush=True)
        failed += not publish(name, options)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
