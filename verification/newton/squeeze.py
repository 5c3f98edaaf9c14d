#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Hard-squeeze set: counts Newton iterations, factorisations and the worst step of bodies that are squeezed in contact.

python3 verification/newton/squeeze.py [--check] [--dry] [--large] [--itr PATH] [--shared ../shared] [--case PART-OF-NAME]...
                                       [--set /KEY=VALUE]... [--spread N] [--jobs N]

Writes squeeze.csv and prints the table of README.md; each run is certified. With --check it stores nothing and compares with
squeeze.csv: the exit status is 1 if a case does not end, is not certified, or takes more than the stored counts allow
(MARGIN). Counts depend neither on how busy the machine is nor on the number of threads. --large adds the scenes that
take minutes, --set changes a key in all of them (a variant), and nothing is stored then, nor with --dry. --spread runs each
case N more times, with a barrier's reach that is larger by 0.1 %, 0.2 %, ...: a variant has to gain more than these differ.
"""
import argparse
import concurrent.futures
import csv
import json
import pathlib
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE.parent))
sys.path.insert(0, str(HERE))
import bodies  # noqa: E402
from harness import stored  # noqa: E402

BALL = "unused/ball-obstacle/2D-noremesh.json"
MASTICATOR = "masticator/3D-noremesh-nref0.json"

# Name, scene of the paper (None: one of bodies.py), what is set, whether it takes minutes.
CASES = [
    ("ball on obstacle, n_refs 0", BALL, [], False),
    ("ball on obstacle, n_refs 1", BALL, ["/geometry/0/n_refs=1"], False),
    ("ball on obstacle, n_refs 2, to t = 0.4", BALL, ["/geometry/0/n_refs=2", "/time/tend=0.4"], False),
    ("masticator 2D, h = 0.1", "masticator/h=0.1-noremesh.json", [], False),
    ("masticator 2D, h = 0.05", "masticator/h=0.05.json", [], False),
    ("masticator 3D, to t = 5", MASTICATOR, ["/time/tend=5"], False),
    ("twisting beam", "twisting-beam/twisting-beam-noremesh-nref0.json", [], False),
    ("spikes 2D", "spikes2d/spikes2d-noremesh.json", [], False),
    ("ball on wall 3D, to t = 0.0024", "ball-wall/3D-noremesh-nref0.json", ["/time/tend=0.0024"], False),
    *((name, None, [], False) for name in bodies.BODIES),
    ("ball on obstacle, n_refs 2", BALL, ["/geometry/0/n_refs=2"], True),
    ("ball on obstacle, n_refs 3, to t = 0.3", BALL, ["/geometry/0/n_refs=3", "/time/tend=0.3"], True),
    ("ball on obstacle, remeshed", "unused/ball-obstacle/2D.json", [], True),
    ("masticator 3D", MASTICATOR, [], True),
    ("rollers, to t = 0.3", "rollers/monkey-soft-hard-noremesh-nref0.json", ["/time/tend=0.3"], True),
    ("ball on spikes, to t = 0.45", "spikes3d/drop-ball-noremesh-nref0.json", ["/time/tend=0.45"], True),
]

# Factors of stored counts. Round-off of another compiler sends a squeezed body another way: the bound is no tighter than that.
MARGIN = {"iterations": 1.15, "factorizations": 1.15, "worst": 1.5}

REACH = 1e-3  # [m], a scene's default of /contact/dhat
STEP_OF_REACH = 1e-3


def reach(path):
    """d̂ of a scene file or of the file it has in common with others."""
    scene = json.loads(path.read_text())
    if "dhat" in scene.get("contact", {}):
        return scene["contact"]["dhat"]
    return reach(path.parent / scene["common"]) if "common" in scene else REACH


def run(case, options, nth=0):
    """The nth run of --spread; 0 is the scene as it is."""
    name, scene, sets, is_large = case
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch) / "out"
        path = options.shared / "paper-scenes/scripts" / scene if scene else bodies.build(name, scratch)
        command = [str(options.itr), "run", str(path), "-o", str(folder), "--threads", "1", "--defaults", "polyfem"]
        spread = [f"/contact/dhat={reach(path) * (1 + STEP_OF_REACH * nth)!r}"] if nth else []
        for assignment in sets + spread + options.set:
            command += ["--set", assignment]
        done = subprocess.run(command, capture_output=True, text=True)
        if not (folder / "steps.jsonl").exists():
            sys.exit(f"{name}: {' '.join(command)} wrote no steps.jsonl, its exit status is {done.returncode}: {done.stderr}")
        certified = subprocess.run([str(options.itr), "certify", str(folder)], capture_output=True).returncode == 0
        steps = [json.loads(line) for line in open(folder / "steps.jsonl")][1:]
    total = lambda key: sum(step[key] for step in steps)  # noqa: E731
    return {"case": name, "large": is_large, "ended": done.returncode == 0, "certified": certified, "steps": len(steps),
            "iterations": total("newton_iterations"), "worst": max(step["newton_iterations"] for step in steps),
            "over_100": sum(step["newton_iterations"] > 100 for step in steps), "factorizations": total("factorizations"),
            "indefinite": total("indefinite"), "processor_seconds": total("processor_seconds"),
            "energy": steps[-1]["energy"]["total"], "commit": stored.made("verification/newton/squeeze.csv")}


def typed(row):
    texts = ("case", "commit")
    return {key: value if key in texts else value == "True" if value in ("True", "False") else
            float(value) if "." in value or "e" in value else int(value) for key, value in row.items()}


def read(path=HERE / "squeeze.csv"):
    with open(path, newline="") as file:
        return [typed(row) for row in csv.DictReader(file)]


def misses(row, bar):
    """What a row does not reach of the stored one, in words."""
    found = [] if row["ended"] and row["certified"] else ["did not end certified"]
    return found + [f"{row[key]} {key}, stored {bar[key]}" for key, margin in MARGIN.items() if row[key] > margin * bar[key]]


def table(rows):
    lines = ["| scene | steps | iterations | worst step | steps over 100 | factorisations | indefinite | energy, last step [J] "
             "| processor s |", "|" + "---|" * 9]
    for row in rows:
        end = "" if row["ended"] else ", stopped"
        end += "" if row["certified"] else ", NOT CERTIFIED"
        lines.append(f"| {row['case']} | {row['steps']}{end} | {row['iterations']} | {row['worst']} | {row['over_100']} "
                     f"| {row['factorizations']} | {row['indefinite']} | {row['energy']:.6g} | {row['processor_seconds']:.1f} |")
    return "\n".join(lines)


def run_all(cases, options):
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        return list(pool.map(lambda case: run(case, options), cases))


FORMS = {"iterations": "d", "worst": "d", "factorizations": "d", "processor_seconds": ".1f", "energy": ".6g"}


def spread_table(cases, options):
    """Means over the runs of each case, and the least and the largest of the single runs."""
    runs = [(case, nth) for case in cases for nth in range(options.spread + 1)]
    with concurrent.futures.ThreadPoolExecutor(options.jobs) as pool:
        rows = list(pool.map(lambda one: run(one[0], options, one[1]), runs))
    lines = ["| scene | iterations | worst step | factorisations | processor seconds | energy, last step [J] |",
             "|---|---|---|---|---|---|"]
    for case in cases:
        own = [row for row in rows if row["case"] == case[0]]
        cells = []
        for key, form in FORMS.items():
            values = [row[key] for row in own]
            mean = sum(values) / len(values)
            cells.append(f"{mean:{form.replace('d', '.0f')}} ({min(values):{form}} to {max(values):{form}})")
        failed = "" if all(row["ended"] and row["certified"] for row in own) else ", NOT ALL ENDED CERTIFIED"
        lines.append(f"| {case[0]}{failed} | {' | '.join(cells)} |")
    return "\n".join(lines)


def check(itr, shared, large=False, jobs=1):
    """Runs the cases; of each its row and what it misses."""
    options = argparse.Namespace(itr=itr, shared=shared, set=[], jobs=jobs)
    bars = {row["case"]: row for row in read()}
    rows = run_all([case for case in CASES if case[0] in bars and (large or not case[3])], options)
    return [(row, misses(row, bars[row["case"]])) for row in rows]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--dry", action="store_true")
    parser.add_argument("--large", action="store_true")
    parser.add_argument("--case", action="append")
    parser.add_argument("--set", action="append", default=[])
    parser.add_argument("--spread", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--itr", type=pathlib.Path, default=ROOT / "build/release/bin/itr")
    parser.add_argument("--shared", type=pathlib.Path, default=ROOT.parent / "shared")
    options = parser.parse_args()
    if options.check:
        found = check(options.itr, options.shared, options.large, options.jobs)
        for row, missing in found:
            print(f"{row['case']}: {'; '.join(missing) or 'as stored or fewer'}")
        sys.exit(any(missing for _, missing in found))
    is_asked = lambda case: not options.case or any(part in case[0] for part in options.case)  # noqa: E731
    cases = [case for case in CASES if (options.large or not case[3]) and is_asked(case)]
    if options.spread:
        print(spread_table(cases, options))
        return
    rows = run_all(cases, options)
    print(table(rows))
    if options.set or options.dry:
        return
    kept = {row["case"]: row for row in read()} if (HERE / "squeeze.csv").exists() else {}
    kept.update({row["case"]: row for row in rows})
    with open(HERE / "squeeze.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(kept[case[0]] for case in CASES if case[0] in kept)


if __name__ == "__main__":
    main()
