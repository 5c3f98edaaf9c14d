#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Runs scenes with "accuracy" and compares what was asked, what the run says of itself, and what it is off by.

/usr/bin/python3 verification/adaptive/accuracy.py [--itr build/release/bin/itr] [--only NAME] [--keep DIR]

Each scene leaves time step, d-hat and tolerances open. It runs with "accuracy" 0.05, 0.02 and 0.01, and with ITR's defaults
(as asked 0). Its reference has quadratic elements, remeshed with a small tolerance or (with contact or inertia) refined uniformly,
d-hat a twentieth of "auto", and many constant increments or a small tolerance in time. `true` is the largest error of stored plus
kinetic energy at asked times, by the largest such energy of the reference; `estimated` is what the closing line says, with its parts;
`hit` tells whether `true` is at most twice `asked`, `fine` whether it is at least half of it. A row of accuracy.csv is a run.
"""
import argparse
import copy
import csv
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import types

import h5py

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE.parent))
from cases import error_bars  # noqa: E402
from harness import stored  # noqa: E402

ASKED = (0.05, 0.02, 0.01)
TIMES = 4  # asked times without inertia
SOURCES = ("mesh", "time", "dhat", "friction", "lag", "solver")
NAMES = ["scene", "asked", "estimated", *SOURCES, "true", "hit", "fine", "steps", "vertices", "seconds", "said", "commit"]


class Scene:
    """`make(context)` gives the scene; the reference is refined so often, is remeshed by this part of the energy or not at
    all, and has these increments, or this tolerance in time, up to the end."""

    def __init__(self, make, refinements=1, mesh=1e-7, increments=TIMES, end=None, tolerance=None, times=TIMES, remesh=True):
        self.make, self.refinements, self.mesh, self.increments = make, refinements, mesh, increments
        self.end, self.tolerance, self.times, self.remesh = end, tolerance, times, remesh

    def content(self, context):
        content = copy.deepcopy(self.make(context))
        is_quasistatic = content["time"].get("quasistatic", False)
        end = self.end or content["time"]["tend"]
        content["time"] = {"tend": end, **({"quasistatic": True} if is_quasistatic else {})}
        content.pop("solver", None)
        content.get("contact", {}).pop("dhat", None)
        content.get("contact", {}).pop("epsv", None)
        content["space"] = {"remesh": {"enabled": True}} if self.remesh else {}
        content["output"] = {"paraview": {"options": {"kinetic_energy": True}}}
        return content


def plucked(context):
    """A beam that starts with a velocity and swings freely."""
    content = error_bars.swinging(context)
    content["boundary_conditions"].pop("rhs")
    content["initial_conditions"] = {"velocity": [{"id": 1, "value": [0, "0.5 * x^2"]}]}
    return content


def example(name):
    def make(context):
        path = ROOT / "examples" / name
        content = json.loads(path.read_text())
        for geometry in content["geometry"]:
            geometry["mesh"] = str((path.parent / geometry["mesh"]).resolve())
        return content
    return make


def membrane(context):
    """Cook's membrane of examples/cantilever.json, loaded by a traction."""
    content = example("cantilever.json")(context)
    content["geometry"][0]["n_refs"] = 1
    return content


SCENES = {
    "cook pulled": Scene(error_bars.cook(0, "8 * t")),
    "cook loaded": Scene(membrane),
    "square sheared": Scene(error_bars.square(0.3, 0.1, 0.2)),
    "block pressed": Scene(error_bars.pressed_block(0), mesh=1e-5),
    "beam plucked, fixed mesh": Scene(plucked, end=0.25, tolerance=3e-3, times=20, remesh=False),
    "hook": Scene(error_bars.hook, mesh=1e-5),
    "half ring": Scene(error_bars.half_ring, mesh=1e-5),
    "disc between plates": Scene(error_bars.disc(0.15), mesh=None, increments=8),
    "block pressed, friction": Scene(error_bars.pressed_block(0.3), mesh=None, increments=8),
    "square falling": Scene(error_bars.falling, end=0.2, tolerance=3e-3, times=20),
    "thin wall": Scene(error_bars.thin_wall),
    "beam swinging": Scene(error_bars.swinging, end=0.25, tolerance=3e-3, times=20),
    "beam plucked": Scene(plucked, end=0.25, tolerance=3e-3, times=20),
}


def call(itr, *words):
    done = subprocess.run([str(itr), *map(str, words)], capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"{' '.join(map(str, words))}: {done.stderr[-500:]}")
    return done.stdout


def run(itr, folder, name, content):
    path, directory = folder / f"{name}.json", folder / name
    path.write_text(json.dumps(content, indent=1))
    if not (directory / "summary.json").exists():
        (folder / f"{name}.txt").write_text(call(itr, "run", path, "-o", directory, "--overwrite", "--threads", 1))
    return directory


def energies(directory, has_inertia):
    """Stored energy, with inertia plus kinetic energy, by time, at the times of frames."""
    found = {}
    with open(directory / "steps.jsonl") as file:
        steps = {step["step"]: step["energy"] for step in map(json.loads, file)}
    for path in sorted((directory / "frames").glob("*.h5")):
        with h5py.File(path) as frame:
            energy = steps[int(frame.attrs["step"])]
            kinetic = float(frame["totals/kinetic_energy"][()].item()) if has_inertia else 0
            found[round(float(frame.attrs["t"]), 9)] = energy["elastic"] + energy["contact"] + kinetic
    return found


def true_error(ours, right):
    return max(abs(ours[t] - right[t]) for t in right if t in ours) / max(right.values())


def estimate(text):
    """What the closing line says: the estimate, its parts, and the line."""
    line = next((line for line in text.splitlines() if line.startswith("accuracy of")), "")
    said = re.search(r"asked, (\S+) % estimated \(([^)]*)\)", line)
    if not said:
        return {"said": line}
    parts = dict(part.split() for part in said[2].split(", ") if part)
    return {"estimated": float(said[1]) / 100, **{name: float(value) / 100 for name, value in parts.items()},
            "said": re.sub(r"^.*?\)(: |, )", "", line)}


def reference(itr, folder, name, scene, content):
    content = copy.deepcopy(content)
    for geometry in content["geometry"]:
        if not geometry.get("is_obstacle"):
            geometry["n_refs"] = scene.refinements
    content["space"] = {"discr_order": 2}
    if scene.mesh and not scene.tolerance:
        content["space"]["remesh"] = {"enabled": True, "relative_tolerance": scene.mesh}
    end = content["time"]["tend"]
    if scene.tolerance:
        content["time"].update({"dt": "auto", "tolerance": scene.tolerance, "output_dt": end / scene.times})
    else:
        content["time"]["dt"] = end / scene.increments
        content["output"]["paraview"]["skip_frame"] = scene.increments // scene.times
    if content.get("contact", {}).get("enabled"):
        path = folder / f"{name}-auto.json"
        time = {key: value for key, value in content["time"].items() if key not in ("tolerance", "output_dt")}
        path.write_text(json.dumps({**content, "time": {**time, "dt": end / 100}}))
        content["contact"]["dhat"] = json.loads(call(itr, "explain", path, "--json"))["settings"]["/contact/dhat"] / 20
    return energies(run(itr, folder, f"{name}-reference", content), "quasistatic" not in content["time"])


def compare(itr, label, scene, folder):
    name = label.replace(",", "").replace(" ", "-")
    base = scene.content(types.SimpleNamespace(folder=folder))
    right = reference(itr, folder, name, scene, base)
    for asked in (*ASKED, 0):
        content = copy.deepcopy(base)
        end = content["time"]["tend"]
        if asked:
            content["accuracy"] = asked
            content["time"]["output_dt"] = end / scene.times
        else:
            content["time"].update({"dt": "auto", "output_dt": end / scene.times})
        directory = run(itr, folder, f"{name}-{asked}", content)
        summary = json.loads((directory / "summary.json").read_text())
        with open(directory / "steps.jsonl") as file:
            vertices = max(json.loads(line)["vertices"] for line in file)
        true = true_error(energies(directory, "quasistatic" not in content["time"]), right)
        row = {"scene": label, "asked": asked, "true": true, "steps": summary["steps"], "vertices": vertices,
               "seconds": summary["processor_seconds"]}
        if asked:
            row.update({**estimate((folder / f"{name}-{asked}.txt").read_text()), "hit": true <= 2 * asked, "fine": true >= asked / 2})
        print(row, flush=True)
        yield row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--itr", type=pathlib.Path, default=ROOT / "build/release/bin/itr")
    parser.add_argument("--only")
    parser.add_argument("--keep", type=pathlib.Path, help="folder for the runs, which are not run again; they are removed without")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.keep or pathlib.Path(temporary)
        folder.mkdir(parents=True, exist_ok=True)
        path, rows = HERE / "accuracy.csv", []
        if options.only and path.exists():
            with open(path, newline="") as file:
                rows = [row for row in csv.DictReader(file) if row["scene"] != options.only]
        for name, scene in SCENES.items():
            if options.only not in (None, name):
                continue
            try:
                new = list(compare(options.itr.resolve(), name, scene, folder))
            except RuntimeError as error:
                new = [{"scene": name, "said": str(error).splitlines()[-1]}]
                print(new[0], flush=True)
            rows += [{**row, "commit": stored.made("verification/adaptive/accuracy.csv")} for row in new]
            with open(path, "w", newline="") as file:
                writer = csv.DictWriter(file, NAMES, lineterminator="\n")
                writer.writeheader()
                for row in rows:
                    writer.writerow({k: f"{v:.3g}" if isinstance(v, float) else v for k, v in row.items()})


if __name__ == "__main__":
    sys.exit(main())
