#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""The boot of boot.json in 3D: half of it, turned about the z axis, of quadratic tetrahedra, with its plane of symmetry held.

usage: boot_3d.py [--itr itr] [--runs DIR] [--keep] [--make-only] [--around N] [--along N] [--through N]

Runs it and boot.json with quadratic elements of edges of 0.4 mm, certifies both, and writes their forces to study/boot_3d.csv and
what the run in 3D took to study/boot_3d.json. It takes a quarter of an hour.
"""

import argparse
import csv
import json
import pathlib

import numpy as np

import make  # finds modules of the folder above
import studies
from make_meshes import boxes, write_msh

STUDY = make.HERE / "study"
FLAT = "/space/discr_order=2"
LEVEL = 1  # of boot.json beside it


def half(around, along, through):
    """Points and tetrahedra of the boot for y >= 0: edges around, along the wall, and through it."""
    shares, cells = boxes((through, along, around), (1, 1, 1))
    shares += 0.5
    radius, z = make.boot(shares[:, :2]).T
    angle = np.pi * shares[:, 2]
    points = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])
    points[np.isclose(shares[:, 2], 1), 1] = 0
    corners = points[cells]
    is_turned = np.linalg.det(corners[:, 1:] - corners[:, :1]) < 0
    cells[is_turned] = cells[is_turned][:, [0, 1, 3, 2]]
    return points, cells


def scene():
    """That of boot.json; surfaces 1 and 2 are the collars, 3 lies in the plane of symmetry."""
    flat = make.PARTS["boot"].content()
    move = flat["boundary_conditions"]["dirichlet_boundary"][0]["value"][1]
    content = {key: value for key, value in flat.items() if key not in ("axisymmetric", "boundary_conditions")}
    content["geometry"] = [{"mesh": "boot_3d.msh", "volume_selection": 1, **make.selected(
        {"box": [[-40, -1, -1], [40, 40, 1e-3]]}, {"box": [[-40, -1, 59.999], [40, 40, 61]]},
        {"box": [[-40, -1, -1], [40, 1e-6, 61]]})}]
    content["space"] = {"discr_order": 2}
    content["boundary_conditions"] = {"dirichlet_boundary": [
        make.held(1, 0, 0, move), make.held(2, 0, 0, 0), {**make.held(3, 0, 0, 0), "dimension": [False, True, False]}]}
    return content


def write(folder, around=16, along=72, through=1):
    folder.mkdir(parents=True, exist_ok=True)
    write_msh(folder / "boot_3d.msh", *half(around, along, through))
    (folder / "boot_3d.json").write_text(json.dumps(scene(), indent=2) + "\n")


def forces(run, column, factor):
    return [factor * row[column] for row in studies.rows(run / "forces.csv", "shaft")]


def differences():
    """Of the stored curves: the largest up to the peak, the largest behind it, that at the end [%]; stroke of the peak [mm]."""
    with open(STUDY / "boot_3d.csv", newline="") as file:
        rows = [[float(value) for value in row] for row in list(csv.reader(file))[1:]]
    rows = [row for row in rows if row[0] > 0]
    peak = max(range(len(rows)), key=lambda k: rows[k][2])
    off = [100 * (solid / flat - 1) for _, solid, flat in rows]
    return max(off[:peak + 1], key=abs), max(off[peak + 1:], key=abs), off[-1], rows[peak][0]


def study(options):
    def run(scene, folder, *words):
        if not (options.keep and (folder / "summary.json").exists()):
            studies.run(options.itr, scene, folder, *words)
        return studies.certified(options.itr, folder)

    make.write(options.runs, ["boot"], LEVEL)
    solid, flat = options.runs / "solid", options.runs / "flat"
    run(options.runs / "boot.json", flat, "--set", FLAT)
    summary = run(options.runs / "boot_3d.json", solid)
    stroke = 25 / 10
    with open(STUDY / "boot_3d.csv", "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["stroke [mm]", "force in 3D [N]", "force of the axisymmetric scene [N]"])
        for k, (a, b) in enumerate(zip(forces(solid, "reaction_z", 2), forces(flat, "reaction_y", 1))):
            writer.writerow([f"{stroke * k:g}", f"{a:.5g}", f"{b:.5g}"])
    keys = ("vertices", "elements", "unknowns", "newton_iterations", "processor_seconds")
    told = {key: summary[key] for key in keys if key in summary} | {
        name: round(value, 2) for name, value in zip(("to_peak", "behind", "end", "peak"), differences())}
    (STUDY / "boot_3d.json").write_text(json.dumps(told, indent=2) + "\n")
    print(json.dumps(told, indent=2))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--itr", default="itr")
    parser.add_argument("--runs", type=pathlib.Path, default=pathlib.Path("boot_3d"))
    parser.add_argument("--keep", action="store_true", help="takes the runs that are in DIR")
    parser.add_argument("--make-only", action="store_true", help="writes mesh and scene, and runs nothing")
    for name, default in (("around", 16), ("along", 72), ("through", 1)):
        parser.add_argument(f"--{name}", type=int, default=default, metavar="N")
    options = parser.parse_args()
    write(options.runs, options.around, options.along, options.through)
    if not options.make_only:
        study(options)


if __name__ == "__main__":
    main()
