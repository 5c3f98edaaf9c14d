#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""A contact scene of a million unknowns to its end: a rubber plate of CELLS x CELLS x 1 cells falls onto a ball. Writes the mesh, the
scene and the run into the work folder, and a row of million.csv: seconds, memory, iterations, and the solver that ran.

/usr/bin/python3 verification/scaling/million.py [--build build/release] [--work DIR] [--cells 410] [--solver auto] [--store] [--resume]
"""
import argparse
import csv
import json
import os
import pathlib
import re
import subprocess
import sys

import numpy

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE.parent))
from harness import stored  # noqa: E402
from harness.scenes import box_mesh  # noqa: E402

CELL = 0.01  # edge of a cell, thickness of the plate [m]
RADIUS, GAP, SPEED, STEP = 0.3, 0.0012, 0.25, 0.001
KEYS = ["cells", "solver", "taken", "threads", "unknowns", "vertices", "tetrahedra", "steps", "newton_iterations", "linear_solves",
        "factorizations", "linear_iterations", "steps_in_contact", "seconds", "linear_s", "assembly_s", "line_search_s", "ccd_s",
        "processor_s", "peak_mb", "certified", "commit"]


def write_plate(file, cells):
    points, tetrahedra = box_mesh((cells, cells, 1), (cells * CELL, cells * CELL, CELL))
    points -= [cells * CELL / 2, cells * CELL / 2, 0]
    with open(file, "w", encoding="ascii") as out:
        out.write(f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{len(points)}\n")
        numpy.savetxt(out, numpy.column_stack([numpy.arange(1, len(points) + 1), points]), fmt="%d %.17g %.17g %.17g")
        out.write(f"$EndNodes\n$Elements\n{len(tetrahedra)}\n")
        head = numpy.tile([0, 4, 2, 1, 1], (len(tetrahedra), 1))
        head[:, 0] = numpy.arange(1, len(tetrahedra) + 1)
        numpy.savetxt(out, numpy.column_stack([head, tetrahedra + 1]), fmt="%d")
        out.write("$EndElements\n")


def write_ball(file, rings=12, sectors=24):
    angles = numpy.pi * numpy.arange(1, rings) / rings, 2 * numpy.pi * numpy.arange(sectors) / sectors
    polar, azimuth = (grid.ravel() for grid in numpy.meshgrid(*angles, indexing="ij"))
    sides = numpy.column_stack([numpy.sin(polar) * numpy.cos(azimuth), numpy.sin(polar) * numpy.sin(azimuth), numpy.cos(polar)])
    points = RADIUS * numpy.vstack([[0, 0, 1], sides, [0, 0, -1]])
    at = lambda ring, sector: 1 + ring * sectors + sector % sectors
    faces = []
    for s in range(sectors):
        faces += [(0, at(0, s), at(0, s + 1)), (len(points) - 1, at(rings - 2, s + 1), at(rings - 2, s))]
        for r in range(rings - 2):
            faces += [(at(r, s), at(r + 1, s), at(r + 1, s + 1)), (at(r, s), at(r + 1, s + 1), at(r, s + 1))]
    with open(file, "w", encoding="ascii") as out:
        out.writelines("v {:.17g} {:.17g} {:.17g}\n".format(*p) for p in points)
        out.writelines("f {} {} {}\n".format(*(v + 1 for v in face)) for face in faces)


def scene(work, steps):
    return {
        "geometry": [{"mesh": str(work / "plate.msh"), "volume_selection": 1,
                      "transformation": {"translation": [0, 0, RADIUS + GAP]}},
                     {"mesh": str(work / "ball.obj"), "is_obstacle": True}],
        "materials": {"type": "NeoHookean", "E": 1e6, "nu": 0.45, "rho": 1000},
        "boundary_conditions": {"rhs": [0, 0, 9.81]},
        "initial_conditions": {"velocity": [{"id": 1, "value": [0, 0, -SPEED]}]},
        "time": {"dt": STEP, "time_steps": steps},
        "contact": {"enabled": True, "dhat": 1e-3, "use_convergent_formulation": True},
        "solver": {"nonlinear": {"solver": "Newton", "x_delta": 1e-4, "grad_norm": 1e-8},
                   "contact": {"barrier_stiffness": 1e6}},
        "output": {"checkpoint_period": 300},
    }


def add_arguments(parser):
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build" / "release")
    parser.add_argument("--work", type=pathlib.Path, default=ROOT / "results" / "million")
    parser.add_argument("--cells", type=int, default=410, help="along an edge of the plate")
    parser.add_argument("--steps", type=int, default=20)
    parser.add_argument("--solver", default="auto")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--resume", action="store_true", help="go on with the run that is in the work folder")


def run(arguments):
    """A row of KEYS without a commit, or None where the run ended badly."""
    work = arguments.work.resolve()
    work.mkdir(parents=True, exist_ok=True)
    if not arguments.resume:
        write_plate(work / "plate.msh", arguments.cells)
        write_ball(work / "ball.obj")
        (work / "scene.json").write_text(json.dumps(scene(work, arguments.steps), indent=1), encoding="utf-8")
    itr, folder = arguments.build / "bin" / "itr", work / "run"
    command = [itr, "run", work / "scene.json", "-o", folder, "--resume" if arguments.resume else "--overwrite", "--threads",
               arguments.threads, "--solver", arguments.solver, "--defaults", "polyfem"]
    with open(work / "log", "w+", encoding="utf-8") as log:
        status = subprocess.run(list(map(str, command)), stdout=log, stderr=log, check=False).returncode
        log.seek(0)
        taken = re.findall(r"auto takes (\S+) for", log.read())
    if status != 0:
        print(f"ended with status {status}, see {work / 'log'}")
        return None
    lines = [json.loads(line) for line in open(folder / "steps.jsonl", encoding="utf-8")]
    steps = lines[1:]
    total = lambda key: sum(step[key] for step in steps)
    seconds = lambda key: round(sum(step["seconds"][key] for step in steps), 3)
    return {"cells": arguments.cells, "solver": arguments.solver, "taken": taken[-1] if taken else arguments.solver,
            "threads": arguments.threads, "unknowns": steps[-1]["unknowns"], "vertices": steps[-1]["vertices"],
            "tetrahedra": steps[-1]["elements"], "steps": len(steps), "newton_iterations": total("newton_iterations"),
            "linear_solves": total("linear_solves"), "factorizations": total("factorizations"),
            "linear_iterations": total("linear_iterations"), "steps_in_contact": sum(step["energy"]["contact"] > 0 for step in steps),
            "seconds": seconds("total"), "linear_s": seconds("linear_solve"), "assembly_s": seconds("assembly"),
            "line_search_s": seconds("line_search"), "ccd_s": seconds("ccd"), "processor_s": round(total("processor_seconds"), 3),
            "peak_mb": round(max(step["peak_rss_mb"] for step in steps)),
            "certified": subprocess.run([str(itr), "certify", str(folder)], stdout=subprocess.DEVNULL, check=False).returncode == 0}


def store(file, row):
    row = {**row, "commit": stored.made(f"verification/scaling/{file.name}")}
    is_new = not file.exists()
    with open(file, "a", newline="", encoding="utf-8") as out:
        writer = csv.DictWriter(out, KEYS)
        if is_new:
            writer.writeheader()
        writer.writerow(row)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add_arguments(parser)
    parser.add_argument("--store", action="store_true", help="add the row to million.csv")
    arguments = parser.parse_args()
    row = run(arguments)
    if row is None:
        return 1
    print(json.dumps(row, indent=1))
    if arguments.store:
        store(HERE / "million.csv", row)
    return 0


if __name__ == "__main__":
    sys.exit(main())
