#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Compares adaptive steps with constant ones: error against Newton iterations and processor seconds, on fixed meshes.

python3 verification/adaptive/run.py [--itr build/release/bin/itr] [--only NAME] [--shared ../shared]

Each scene is run by BDF2 with constant steps, with adaptive ones of several tolerances, and with steps several times shorter
than the shortest of these as the reference. `error` is that of displacements at 20 asked times (root mean square over bodies
and time, relative: `itr distance`), for the hook, which has no inertia, that of its two peak forces. `error_each` is the root
mean square over these times of the error relative to the displacement at that time. A row of results.csv is a run; `gain`
is the number of iterations of constant steps of equal error, interpolated between runs in logarithms, by that of this run:
">" where no constant step is as right. Iterations count all trials, rejected ones too. Runs in --keep are not run again.
"""
import argparse
import csv
import json
import math
import pathlib
import subprocess
import sys
import tempfile

import h5py
import numpy as np

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE.parent))
from harness import stored  # noqa: E402


def rectangle(path, width, height, columns, rows, place):
    """A mesh of triangles as an OBJ file."""
    with open(path, "w") as file:
        for j in range(rows + 1):
            for i in range(columns + 1):
                x, y = place(width * i / columns, height * j / rows)
                file.write(f"v {x} {y} 0\n")
        for j in range(rows):
            for i in range(columns):
                a = j * (columns + 1) + i + 1
                b, c, d = a + 1, a + columns + 2, a + columns + 1
                file.write(f"f {a} {b} {c}\nf {a} {c} {d}\n")


def hook(folder):
    """A beam that is pushed over a bump, nose first, and pulled back."""
    def nose(x, y):
        return x, y - 0.0015 * max(0, 1 - abs(x - 0.018) / 0.002) * (1 - y / 0.002)

    rectangle(folder / "hook.obj", 0.02, 0.002, 40, 4, nose)
    (folder / "bump.obj").write_text("v 0.0205 -0.003 0\nv 0.0225 -0.0005 0\nv 0.0245 -0.003 0\nl 1 2 3\n")
    scene = {"geometry": [{"mesh": "hook.obj", "volume_selection": 1, "surface_selection": {"threshold": 1e-6}},
                          {"mesh": "bump.obj", "is_obstacle": True}],
             "materials": {"type": "NeoHookean", "E": 2e9, "nu": 0.35, "rho": 1000},
             "boundary_conditions": {"dirichlet_boundary": [{"id": 1, "value": ["0.006 * (1 - abs(1 - t))", 0]}]},
             "contact": {"enabled": True, "friction_coefficient": 0.3},
             "output": {"forces": [{"name": "hook", "bodies": 1}]}}
    path = folder / "hook.json"
    path.write_text(json.dumps(scene))
    return path


class Case:
    """A scene, where it ends, when it is compared, and its steps."""

    def __init__(self, scene, end, steps, tolerances, finest, sets=(), quasistatic=False):
        self.scene, self.end, self.steps, self.tolerances = scene, end, steps, tolerances
        self.finest, self.sets, self.quasistatic = finest, list(sets), quasistatic
        self.frames = 20


def cases(folder, scenes):
    off = ["/space/remesh/enabled=false"]
    return {
        "ball-wall": Case(scenes / "ball-wall/2D.json", 0.012, (200, 400, 800, 1600, 3200), (0.3, 0.1, 0.03), 12800, off),
        "drop": Case(ROOT / "examples/tasks/drop.json", 0.5, (100, 200, 400, 800, 1600, 3200), (0.3, 0.1, 0.03, 0.01), 12800, off),
        "hook": Case(hook(folder), 2, (30, 60, 120, 240, 480, 960, 1920), (0.3, 0.1, 0.03, 0.01), 15360, quasistatic=True),
        "masticator": Case(scenes / "masticator/h=0.1-noremesh.json", 3, (60, 120, 240, 480, 960), (0.3, 0.1, 0.03), 3840,
                           ["/solver/contact/friction_iterations=30"]),
    }


def run(itr, case, time, directory, skip):
    time = {"tend": case.end, **({"quasistatic": True} if case.quasistatic else {"integrator": "BDF2"}), **time}
    sets = [f"/time={json.dumps(time)}", f"/output/paraview/skip_frame={skip}", *case.sets]
    if (directory / "summary.json").exists():
        return figures(directory)
    words = [str(itr), "run", str(case.scene), "-o", str(directory), "--overwrite", "--threads", "1"]
    for text in sets:
        words += ["--set", text]
    done = subprocess.run(words, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{directory.name}: {done.stderr[-500:]}")
    return figures(directory)


def figures(directory):
    summary = json.loads((directory / "summary.json").read_text())
    return {"steps": summary["steps"], "rejected": summary.get("rejected_steps", 0),
            "iterations": summary["newton_iterations"], "seconds": summary["processor_seconds"],
            "estimate": summary.get("time_error", "")}


def error_of(itr, case, directory, reference):
    if case.quasistatic:
        def peaks(of):
            with open(of / "forces.csv", newline="") as file:
                forces = [float(row["reaction_x"]) for row in csv.DictReader(file)]
            return max(forces), min(forces)
        return max(abs(a / b - 1) for a, b in zip(peaks(directory), peaks(reference)))
    done = subprocess.run([str(itr), "distance", str(directory), str(reference)], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)["l2"]


def error_each(directory, reference):
    """Of the times, without the first."""
    def displacements(of):
        found = {}
        for path in sorted((of / "frames").glob("*.h5")):
            with h5py.File(path) as frame:
                found[round(float(frame.attrs["t"]), 9)] = frame["fields/u"][:]
        return found

    ours, right = displacements(directory), displacements(reference)
    parts = [np.linalg.norm(ours[t] - right[t]) / np.linalg.norm(right[t]) for t in sorted(set(ours) & set(right))[1:]
             if np.linalg.norm(right[t]) > 0]
    return float(np.sqrt(np.mean(np.square(parts))))


def gain(row, constant, error):
    """Iterations of constant steps of equal error by those of the row."""
    ordered = sorted(constant, key=lambda other: other["iterations"])
    if row[error] < min(other[error] for other in ordered):
        return f">{ordered[-1]['iterations'] / row['iterations']:.2g}"
    for coarse, fine in zip(ordered, ordered[1:]):
        if fine[error] <= row[error] <= coarse[error]:
            part = math.log(row[error] / coarse[error]) / math.log(fine[error] / coarse[error])
            cost = math.log(coarse["iterations"]) * (1 - part) + math.log(fine["iterations"]) * part
            return f"{math.exp(cost) / row['iterations']:.2f}"
    return ""


def compare(itr, name, case, folder):
    """Rows of a scene."""
    rows, constant = [], []
    every = 1 if case.quasistatic else None
    reference = folder / f"{name}-reference"
    run(itr, case, {"dt": case.end / case.finest}, reference, every or case.finest // case.frames)

    def errors(of):
        found = {"error": error_of(itr, case, of, reference)}
        return found if case.quasistatic else {**found, "error_each": error_each(of, reference)}

    for steps in case.steps:
        directory = folder / f"{name}-{steps}"
        found = run(itr, case, {"dt": case.end / steps}, directory, every or steps // case.frames)
        row = {"scene": name, "kind": "constant", "setting": steps, **found, **errors(directory)}
        constant.append(row)
        rows.append(row)
        print(row, flush=True)
    for tolerance in case.tolerances:
        directory = folder / f"{name}-auto-{tolerance}"
        time = {"dt": "auto", "tolerance": tolerance}
        if not case.quasistatic:
            time["output_dt"] = case.end / case.frames
        found = run(itr, case, time, directory, 1)
        row = {"scene": name, "kind": "adaptive", "setting": tolerance, **found, **errors(directory)}
        for error in set(row) & {"error", "error_each"}:
            row[error.replace("error", "gain")] = gain(row, constant, error)
        rows.append(row)
        print(row, flush=True)
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--itr", type=pathlib.Path, default=ROOT / "build/release/bin/itr")
    parser.add_argument("--shared", type=pathlib.Path, default=ROOT.parent / "shared")
    parser.add_argument("--only")
    parser.add_argument("--keep", type=pathlib.Path, help="folder for the runs; they are removed without")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        names = ["scene", "kind", "setting", "steps", "rejected", "iterations", "seconds", "estimate", "error", "gain",
                 "error_each", "gain_each", "commit"]
        path, old = HERE / "results.csv", []
        if options.only and path.exists():
            with open(path, newline="") as file:
                old = [row for row in csv.DictReader(file) if row["scene"] != options.only]
        rows = [row for name, case in cases(folder, options.shared / "paper-scenes/scripts").items() if options.only in (None, name)
                for row in compare(options.itr.resolve(), name, case, folder)]
        for row in rows:
            row["commit"] = stored.made("verification/adaptive/results.csv")
        with open(path, "w", newline="") as file:
            writer = csv.DictWriter(file, names, lineterminator="\n")
            writer.writeheader()
            for row in old + rows:
                writer.writerow({k: f"{v:.4g}" if isinstance(v, float) else v for k, v in row.items()})


if __name__ == "__main__":
    sys.exit(main())
