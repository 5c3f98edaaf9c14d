#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Runs each scene on three meshes (the boot's sector on two) to its end, certifies it, and compares a result with a reference.

usage: study.py [--itr itr] [--runs DIR] [--keep] [--ccx] [--pictures] [SCENE...]

Writes study/SCENE.csv, a row a mesh, and the table of README.md from all of these. The reference is a closed form; or CalculiX
(--ccx runs it again, else the value stands in study/references.json); or a finer mesh, or quadratic elements on the second one.
--pictures draws the coarsest runs: rubber.png and boot_sector.png.
"""

import argparse
import csv
import dataclasses
import json
import pathlib
import subprocess
import sys

import h5py
import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.collections import LineCollection, PolyCollection
from PIL import Image

import make  # finds modules of the folder above
import calculix
import studies

HERE = pathlib.Path(__file__).resolve().parent
STUDY = HERE / "study"
LEVELS = 3
HEIGHT = 380  # of a part's picture [pixels]
G = 1.8 / (2 * 1.4997)  # of the bushings [MPa]


def section(shares):
    return [10, -30] + shares * [10, 60]


def forces(run, name):
    return studies.rows(run / "forces.csv", name)


def last(name, column, sign=1):
    return lambda run: sign * forces(run, name)[-1][column]


def largest(name, column, sign=1):
    return lambda run: max(sign * row[column] for row in forces(run, name))


def first_stiffness(run):
    row = forces(run, "pin")[1]
    return row["reaction_x"] / (3 * row["t"])


def whole(value):
    """Of the boot, by that of its sector."""
    return lambda run: 2 * np.pi / make.SECTOR * value(run)


def sealing_margin(run):
    """Peak pressure on the lid less that of the fluid."""
    with h5py.File(sorted((run / "frames").glob("*.h5"))[-1]) as file:
        x, pressure = file["/fields/x"][:], file["/fields/contact_pressure"][:]
    return pressure[x[:, 1] > 1.3].max() - 5


def rise_at_leak(run):
    """Of the lid from t = 2 on, to a step."""
    steps = [json.loads(line) for line in (run / "steps.jsonl").read_text().splitlines()]
    return next(step["t"] for step in steps if step.get("leaks", 0) > 0) - 2


@dataclasses.dataclass
class Case:
    quantity: str
    unit: str
    value: object          # of a run's folder
    reference: object      # a number, how a finer run is made, or a function of a folder that runs CalculiX
    levels: int = LEVELS

    def source(self):
        return self.reference if isinstance(self.reference, str) else "CalculiX" if callable(self.reference) else "closed form"


def sheared():
    """Of simple shear 1, less what the free ends take at small strains (Rivlin & Saunders 1949)."""
    C, shear, width, height = make.YEOH["C"], 1, 40, 4
    stress = 2 * shear * sum((k + 1) * c * shear ** (2 * k) for k, c in enumerate(C))
    return stress * width / (1 + height**2 / (3 * width**2))


def pushed_sideways(a, b):
    """Of a long bushing at small strains, by Muskhelishvili's potentials A ln z + B z^2 and -kappa A ln z + C/z^2; for
    kappa = 1 that of Adkins & Gent (1954)."""
    kappa = 3 - 4 * make.BUSHING["nu"]
    return 2 * np.pi * (1 + kappa) * G / (kappa * np.log(b / a) - (b**2 - a**2) / (kappa * (a**2 + b**2)))


def calculix_of(name, place, counts, moves):
    return lambda folder: calculix.axial_reaction(folder, place, counts, make.PARTS[name].scene["materials"], moves)


LEFT, RIGHT, BOTTOM, TOP = (0, 0), (0, 1), (1, 0), (1, 1)
BOOT = calculix_of("boot", make.boot, (2, 80), [(BOTTOM, (0, 25)), (TOP, (0, 0))])
TOP_FORCE = largest("top", "reaction_y", -1)
CASES = {
    "shear": Case("force at 100 % shear", "N/mm", last("plate", "reaction_x"), sheared()),
    "bushing_radial": Case("stiffness at 3 % of the wall", "N/mm²", first_stiffness, pushed_sideways(10, 20)),
    "bushing_torsion": Case("moment at 45°", "N", last("pin", "reaction_moment"), 4 * np.pi * G * 400 / 3 * np.pi / 4),
    "bushing_axial": Case("force at 5 mm", "N", last("pin", "reaction_y"),
                          calculix_of("bushing_axial", section, (8, 48), [(LEFT, (0, 5)), (RIGHT, (0, 0))])),
    "oring": Case("peak contact pressure less the fluid's", "MPa", sealing_margin, "a finer mesh"),
    "seal_ogden": Case("largest force of the half", "N/mm", TOP_FORCE, "quadratic elements"),
    "seal_yeoh": Case("largest force of the half", "N/mm", TOP_FORCE, "quadratic elements"),
    "boot": Case("force at 25 mm", "N", last("shaft", "reaction_y"), BOOT),
    "boot_sector": Case("force of the whole boot at 25 mm", "N", whole(last("shaft", "reaction_z")), BOOT, levels=2),
    "lip_seal": Case("radial force on the shaft", "N", last("shaft", "contact_x", -1), "quadratic elements"),
}


def run(options, scene, folder, *sets):
    if not (options.keep and (folder / "summary.json").exists()):
        studies.run(options.itr, scene, folder, *(word for pair in sets for word in ("--set", pair)))
    return studies.certified(options.itr, folder)


def reference(name, case, options, folder):
    """A number from references.json, or a new one."""
    if isinstance(case.reference, (float, np.floating)):
        return case.reference
    path = STUDY / "references.json"
    stored = json.loads(path.read_text()) if path.exists() else {}
    if callable(case.reference) and (options.ccx or name not in stored):
        stored[name] = case.reference(folder / "ccx" / name)
    elif case.reference == "quadratic elements":
        fine = folder / f"{name}-fine"
        run(options, folder / "1" / f"{name}.json", fine, "/space/discr_order=2")
        stored[name] = case.value(fine)
    elif case.reference == "a finer mesh":
        fine = folder / f"{name}-fine"
        make.write(folder / str(LEVELS), [name], LEVELS)
        run(options, folder / str(LEVELS) / f"{name}.json", fine)
        stored[name] = case.value(fine)
    path.write_text(json.dumps(stored, indent=2) + "\n")
    return stored[name]


def study(name, options):
    case, results = CASES[name], []
    for level in range(case.levels):
        folder = options.runs / str(level)
        make.write(folder, [name], level)
        result = options.runs / f"{name}-{level}"
        summary = run(options, folder / f"{name}.json", result)
        results.append((make.MESHES[make.PARTS[name].mesh][0] / 2**level, summary["vertices"], case.value(result),
                        summary["newton_iterations"], summary["processor_seconds"]))
    exact = reference(name, case, options, options.runs)
    with open(STUDY / f"{name}.csv", "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["h [mm]", "vertices", f"{case.quantity} [{case.unit}]", "reference", "error [%]", "Newton iterations",
                         "processor seconds"])
        for h, vertices, value, iterations, seconds in results:
            writer.writerow([h, vertices, f"{value:.5g}", f"{exact:.5g}", f"{100 * (value / exact - 1):.2f}", iterations,
                             f"{seconds:.2g}"])
    print((STUDY / f"{name}.csv").read_text())


def draw_end(run, path):
    frame = max(int(frame.stem) for frame in (run / "frames").glob("*.h5"))
    subprocess.run([sys.executable, HERE.parent / "render.py", run, "-o", path, "--frames", str(frame)], check=True)


def draw(runs):
    """The last frames of the coarsest runs: those of plane sections in one picture."""
    draw_end(runs / "boot_sector-0", HERE / "boot_sector.png")
    pictures = []
    for name in CASES:
        if name == "boot_sector":
            continue
        path = runs / f"{name}.png"
        draw_end(runs / f"{name}-0", path)
        with Image.open(path) as picture:
            scale = min(HEIGHT / picture.height, 2 * HEIGHT / picture.width)
            pictures.append(picture.convert("RGB").resize((round(picture.width * scale), round(picture.height * scale))))
    rows = [pictures[k:k + 3] for k in range(0, len(pictures), 3)]
    page = Image.new("RGB", (max(sum(p.width for p in row) for row in rows), HEIGHT * len(rows)), "white")
    for j, row in enumerate(rows):
        x = 0
        for picture in row:
            page.paste(picture, (x, j * HEIGHT + (HEIGHT - picture.height) // 2))
            x += picture.width
    page.quantize(96).save(HERE / "rubber.png", optimize=True)


def draw_leak(run):
    """Closed, under pressure, before and after the leak; wet facets are black: oring_leak.png."""
    leak = round((2 + rise_at_leak(run)) / 0.05)
    figure, axes = plt.subplots(1, 4, figsize=(12, 2), layout="constrained")
    for axis, step in zip(axes, (20, 40, leak - 1, leak)):
        with h5py.File(run / "frames" / f"{step:06d}.h5") as file:
            x, cells, surface = file["/fields/x"][:], file["/mesh/simplices"][:], file["/mesh/surface"][:]
            wet = [surface[file[f"/sets/facets/{name}"][:]] for name in ("inlet", "wet top") if f"/sets/facets/{name}" in file]
            walls, corners = file["/obstacles/edges"][:], file["/obstacles/x"][:]
        axis.add_collection(PolyCollection(x[cells], facecolor="#f2d9b3", edgecolor="#b08d57", linewidth=0.4))
        axis.add_collection(LineCollection(x[np.concatenate(wet)], color="black", linewidth=3))
        axis.add_collection(LineCollection(corners[walls], color="grey", linewidth=2))
        axis.set(title=f"t = {step * 0.05:g} s", xlim=(-3, 2.6), ylim=(-0.1, 2.3), aspect="equal")
        axis.axis("off")
    figure.savefig(HERE / "oring_leak.png", dpi=90)


def table():
    lines = ["| scene | result | h [mm] | values | reference | error of the finest | longest run |",
             "|---|---|---|---|---|---|---|"]
    for name, case in CASES.items():
        path = STUDY / f"{name}.csv"
        if not path.exists():
            continue
        with open(path, newline="") as file:
            rows = list(csv.reader(file))[1:]
        h, _, value, exact, error, _, seconds = zip(*rows)
        lines.append(f"| `{name}.json` | {case.quantity} [{case.unit}] | {', '.join(h)} | {', '.join(value)} | "
                     f"{exact[0]}, {case.source()} | {error[-1]} % | {seconds[-1]} s |")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="*", metavar="SCENE")
    parser.add_argument("--itr", default="itr")
    parser.add_argument("--runs", type=pathlib.Path, default=pathlib.Path("rubber"))
    parser.add_argument("--keep", action="store_true", help="takes the runs that are in DIR")
    parser.add_argument("--ccx", action="store_true")
    parser.add_argument("--pictures", action="store_true")
    options = parser.parse_args()
    STUDY.mkdir(exist_ok=True)
    for name in options.scenes or CASES:
        study(name, options)
    studies.write_table(HERE / "README.md", table())
    if options.pictures:
        draw(options.runs)
        make.write(options.runs, ["oring_leak"], 1)
        run(options, options.runs / "oring_leak.json", options.runs / "oring_leak")
        draw_leak(options.runs / "oring_leak")


if __name__ == "__main__":
    main()
