#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Newton iterations of the paper's scenes by the way in which an indefinite Hessian is dealt with.

python3 verification/newton/run.py [--itr PATH] [--shared ../shared] [--timeout SECONDS]

Writes results.csv and prints the table of README.md. Iterations do not depend on how busy the machine is; seconds do.
"""
import argparse
import csv
import json
import pathlib
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE.parent))
from harness import stored  # noqa: E402

SCENES = [
    ("masticator 2D, h = 0.1", "masticator/h=0.1-noremesh.json", []),
    ("spikes 2D", "spikes2d/spikes2d-noremesh.json", []),
    ("ball on wall 2D", "ball-wall/2D-noremesh.json", []),
    ("twisting beam", "twisting-beam/twisting-beam-noremesh-nref0.json", []),
]

KEY = "/solver/nonlinear/Newton/"
VARIANTS = [
    ("ours: true Hessian first, 5 clamped after a failure, extended steps", []),
    ("without extended steps", ["extend_steps=false"]),
    ("always clamped", ["projected_iterations=0"]),
    ("always clamped, without extended steps", ["projected_iterations=0", "extend_steps=false"]),
    ("true Hessian first, 1 clamped after a failure", ["projected_iterations=1"]),
    ("never projected, shifted by multiples of I", ["use_psd_projection=false"]),
]


def run(options, scene, sets, keys, folder):
    command = [str(options.itr), "run", str(options.shared / "paper-scenes/scripts" / scene), "-o", str(folder), "--overwrite",
               "--threads", "1", "--defaults", "polyfem"]
    for assignment in sets + [KEY + key for key in keys]:
        command += ["--set", assignment]
    try:
        subprocess.run(command, capture_output=True, timeout=options.timeout)
    except subprocess.TimeoutExpired:
        pass
    lines = [json.loads(line) for line in open(folder / "steps.jsonl")][1:]
    return {"steps": len(lines), "iterations": sum(line["newton_iterations"] for line in lines),
            "most": max(line["newton_iterations"] for line in lines),
            "seconds": sum(line["seconds"]["total"] - line["seconds"]["output"] for line in lines)}


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--itr", type=pathlib.Path, default=ROOT / "build/release/bin/itr")
    parser.add_argument("--shared", type=pathlib.Path, default=ROOT.parent / "shared")
    parser.add_argument("--timeout", type=float, default=120)
    options = parser.parse_args()
    rows = []
    for name, scene, sets in SCENES:
        for variant, keys in VARIANTS:
            with tempfile.TemporaryDirectory() as scratch:
                row = {"scene": name, "variant": variant, **run(options, scene, sets, keys, pathlib.Path(scratch) / "out"),
                       "commit": stored.made("verification/newton/results.csv")}
            rows.append(row)
            print(row, flush=True)
    with open(HERE / "results.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)
    names = [name for name, _, _ in SCENES]
    print("| variant | " + " | ".join(names) + " |\n|" + "---|" * (len(names) + 1))
    for variant, _ in VARIANTS:
        cells = []
        for name in names:
            ours, row = (next(r for r in rows if r["scene"] == name and r["variant"] == v) for v in (VARIANTS[0][0], variant))
            whole = row["steps"] == ours["steps"]
            cells.append(f"{row['iterations']} ({row['most']})" + ("" if whole else f", {row['steps']} steps"))
        print(f"| {variant} | " + " | ".join(cells) + " |")


if __name__ == "__main__":
    main()
