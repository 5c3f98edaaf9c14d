#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Measures runs with one thread and with two in turn, phase by phase, and draws what their profiles predict for more cores.

python3 verification/scaling/threads.py [--pairs 5] [--scene NAME ...] [--itr PATH] [--shared DIR]

Writes threads.csv (a line a phase), threads.md and threads.svg beside this file. Measure on idle cores.
"""
import argparse
import collections
import csv
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
CORES = (2, 4, 16, 64)  # of which profiles predict the wall time

# Name, the paper's scene, and what --set changes.
SCENES = [
    ("ball-wall 3D, n_refs 1", "ball-wall/3D-noremesh-nref1.json", ["/time/tend=0.0016"]),
    ("twisted bar, n_refs 1", "twisting-beam/twisting-beam-noremesh-nref1.json", ["/time/tend=0.3"]),
    ("twisted bar, n_refs 2", "twisting-beam/twisting-beam-noremesh-nref2.json", ["/time/tend=0.05"]),
    ("rollers", "rollers/monkey-soft-hard-noremesh-nref0.json", ["/time/tend=0.1"]),
    ("rollers, n_refs 1", "rollers/monkey-soft-hard-noremesh-nref0.json", ["/geometry/0/n_refs=1", "/time/tend=0.04"]),
    ("masticator 3D, remeshed", "masticator/3D.json", ["/time/tend=1.3"]),
    ("ball-wall 3D, remeshed", "ball-wall/3D.json", ["/time/tend=0.0014"]),
    ("ball on spikes, remeshed", "spikes3d/drop-ball.json", ["/time/tend=0.36"]),
    ("masticator 2D, h 0.05", "masticator/h=0.05-noremesh.json", ["/time/tend=1"]),
]


def run(itr, path, sets, threads):
    """Sums of the phases of a run, by name: wall, processor, work, span [s] and predicted wall times by cores."""
    with tempfile.TemporaryDirectory() as folder:
        command = [itr, "run", path, "-o", folder, "--overwrite", "--profile", "--defaults", "polyfem", "--threads", str(threads)]
        for change in sets:
            command += ["--set", change]
        done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
        if done.returncode != 0:
            sys.exit(f"{path} with {threads} threads: {done.stderr}")
        phases = collections.defaultdict(collections.Counter)
        for line in open(os.path.join(folder, "profile.jsonl")):
            for phase in json.loads(line)["phases"]:
                name = phase["phase"]
                for key in ("wall", "processor", "work", "span"):
                    phases[name][key] += phase[key]
                for cores in CORES:
                    phases[name][f"predicted {cores}"] += phase["predicted"][str(cores)]
        whole = collections.Counter()
        for phase in phases.values():
            whole.update(phase)
        phases["all"] = whole
        return phases


def measure(itr, shared, scene, pairs):
    """Rows of one scene: medians over interleaved pairs of runs."""
    name, path, sets = scene
    path = shared / "paper-scenes" / "scripts" / path
    runs = {1: [], 2: []}
    for _ in range(pairs):
        for threads in runs:
            runs[threads].append(run(itr, path, sets, threads))
    rows = []
    for phase in sorted(runs[1][0], key=lambda key: -runs[1][0][key]["wall"]):
        one = {key: statistics.median(r[phase][key] for r in runs[1]) for key in runs[1][0][phase]}
        two = statistics.median(r[phase]["wall"] for r in runs[2] if phase in r)
        rows.append({"scene": name, "phase": phase, "one": one["wall"], "two": two, "ratio": one["wall"] / max(two, 1e-9),
                     "work": one["work"], "span": one["span"],
                     **{f"predicted {cores}": one[f"predicted {cores}"] for cores in CORES}})
    return rows


def write_table(rows, path):
    with open(path, "w") as file:
        file.write("| scene | one thread [s] | two [s] | ratio | predicted 2 | 4 | 16 | 64 | span [s] |\n"
                   "|---|---|---|---|---|---|---|---|---|\n")
        for row in rows:
            if row["phase"] == "all":
                ahead = " | ".join(f"{row['one'] / row[f'predicted {cores}']:.2f}" for cores in CORES)
                file.write(f"| {row['scene']} | {row['one']:.2f} | {row['two']:.2f} | {row['ratio']:.2f} | {ahead} | {row['span']:.2f} |\n")
        file.write("\nPhases that take at least 3 % of a run:\n\n| scene | phase | share | one thread [s] | two [s] | ratio | predicted 2 | 16 |\n"
                   "|---|---|---|---|---|---|---|---|\n")
        for scene in dict.fromkeys(row["scene"] for row in rows):
            of_scene = {row["phase"]: row for row in rows if row["scene"] == scene}
            whole = of_scene.pop("all")["one"]
            for phase, row in of_scene.items():
                if row["one"] >= 0.03 * whole:
                    file.write(f"| {scene} | {phase} | {row['one'] / whole:.2f} | {row['one']:.2f} | {row['two']:.2f} | {row['ratio']:.2f} | "
                               f"{row['one'] / row['predicted 2']:.2f} | {row['one'] / row['predicted 16']:.2f} |\n")


def draw(rows, path):
    import matplotlib
    matplotlib.use("svg")
    import matplotlib.pyplot as plt
    figure, axes = plt.subplots(figsize=(7, 4.5))
    for row in rows:
        if row["phase"] == "all":
            line, = axes.plot([1, *CORES], [row["one"], *(row[f"predicted {cores}"] for cores in CORES)], "--", lw=1)
            axes.plot([1, 2], [row["one"], row["two"]], "o-", color=line.get_color(), label=row["scene"])
    axes.set(xscale="log", yscale="log", xlabel="threads", ylabel="wall time [s] (dashed: predicted)")
    axes.set_xticks([1, *CORES], [1, *CORES])
    axes.legend(fontsize=7)
    figure.savefig(path, bbox_inches="tight")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=5)
    parser.add_argument("--scene", action="append", help="names that begin so; all where none is given")
    parser.add_argument("--itr", default=str(ROOT / "build" / "release" / "bin" / "itr"))
    parser.add_argument("--shared", type=pathlib.Path, default=ROOT.parent / "shared")
    parser.add_argument("--to", type=pathlib.Path, default=HERE, help="folder of the results")
    options = parser.parse_args()
    rows = []
    for scene in SCENES:
        if options.scene is None or any(scene[0].startswith(name) for name in options.scene):
            rows += measure(options.itr, options.shared, scene, options.pairs)
            whole = next(row for row in rows[::-1] if row["phase"] == "all")
            print(f"{scene[0]}: {whole['one']:.2f} s, {whole['two']:.2f} s, ratio {whole['ratio']:.2f}, "
                  f"predicted {whole['one'] / whole['predicted 2']:.2f}", flush=True)
    with open(options.to / "threads.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows({key: f"{value:.4g}" if isinstance(value, float) else value for key, value in row.items()} for row in rows)
    write_table(rows, options.to / "threads.md")
    draw(rows, options.to / "threads.svg")


if __name__ == "__main__":
    main()
