#!/usr/bin/python3
# SPDX-License-Identifier: MIT
"""Runs the scenes of assemblies on three meshes each, certifies them and compares them with closed forms, beam theory or
CalculiX: study/SCENE.csv.

usage: study.py [-o DIR] [--itr COMMAND] [--levels N] [SCENE...]

The table of README.md is made from study/.
"""
import argparse
import csv
import json
import math
import pathlib
import resource

import numpy as np

import make
import peers
import studies
from make import (ALUMINIUM, BORE, END, FIT, GRAVITY, OVERLAP, RIM, STEEL, STRIP, STRIP_HEIGHT, SUPPORT)


def forces(folder, name):
    return studies.rows(folder / "forces.csv", name)


def points(folder, name):
    return studies.rows(folder / "points.csv", name)


def press_fit_pressure():
    """Lame, in plane stress [MPa]."""
    hub = ((FIT**2 + BORE**2) / (FIT**2 - BORE**2) - STEEL["nu"]) / STEEL["E"]
    ring = ((RIM**2 + FIT**2) / (RIM**2 - FIT**2) + ALUMINIUM["nu"]) / ALUMINIUM["E"]
    return OVERLAP / (FIT * (hub + ring))


def rim_growth(pressure):
    return 2 * pressure * FIT**2 * RIM / (ALUMINIUM["E"] * (RIM**2 - FIT**2))


def pressure_of(area):
    return lambda folder: {"pressure": -forces(folder, "hub")[-1]["contact_x"] / area}


def shrink_fit(folder):
    return pressure_of(2 * math.pi * FIT * 10)(folder) | {"rim": points(folder, "rim")[-1]["u_x"]}


def lies(folder):
    """How far the middle and the ends of the strip are from the line through its points above the supports."""
    middle, end, above = (points(folder, name)[-1]["y"] for name in ("middle", "end", "above"))
    return {"middle": middle - above, "end": end - above}


def strip_of_beam():
    """Timoshenko's beam on two supports, with overhangs."""
    E, span, over = STRIP["E"], 2 * SUPPORT, END - SUPPORT
    w, EI = STRIP["rho"] * GRAVITY * STRIP_HEIGHT, E * STRIP_HEIGHT**3 / 12
    GA = 5 / 6 * E / 2 / (1 + STRIP["nu"]) * STRIP_HEIGHT
    middle = 5 * w * span**4 / (384 * EI) - w * over**2 * span**2 / (16 * EI) + w * span**2 / (8 * GA)
    slope = w * span**3 / (24 * EI) - w * over**2 * span / (4 * EI)
    end = slope * over - w * over**4 / (8 * EI) - w * over**2 / (2 * GA)
    return {"middle": -middle, "end": end}


def mount(folder):
    return {"sag": -points(folder, "top")[-1]["u_y"]}


def hook(folder):
    """How far the carriage is at two forces, and the last force before the hook snaps in."""
    table = [row["u_x"] for row in points(folder, "carriage")]
    held = max(k for k, travel in enumerate(table) if travel < 5)
    return {"travel at 0.75 N/mm": table[10], "travel at 1.2 N/mm": table[16], "snaps in above": 1.5 * held / (len(table) - 1)}


def hook_of_peer(folder, refine, results):
    travel, force = peers.snap_hook(folder, 1)
    return {f"travel at {at} N/mm": float(np.interp(at, force, travel)) for at in (0.75, 1.2)}


def grip(folder):
    """Forces on the disc half-way and at the end."""
    curve = forces(folder, "disc")
    return {f"force at {t} s": math.hypot(curve[k]["all_x"], curve[k]["all_y"]) for k, t in ((5, 0.5), (10, 1))}


def grip_of_peer(folder, refine, results):
    pressures = [row["pressure"] for row in forces(results, "chambers")][1:]
    half, whole = (peers.gripper(folder, refine // 2, some) for some in (pressures[:5], pressures))
    return {"force at 0.5 s": math.hypot(*half), "force at 1 s": math.hypot(*whole)}


LAME = {"pressure": press_fit_pressure()}
STUDIES = {  # what is measured, and a function (folder, finest refinement, finest results) of what it should be
    "press_fit": (pressure_of(FIT), lambda *_: LAME),
    "press_fit_moved": (pressure_of(FIT), lambda *_: LAME),
    "press_fit_axisymmetric": (pressure_of(2 * math.pi * FIT * 10), lambda *_: LAME),
    "press_fit_3d": (pressure_of(FIT / 2), lambda *_: LAME),
    "shrink_fit": (shrink_fit, lambda *_: LAME | {"rim": rim_growth(LAME["pressure"]) - (OVERLAP + 0.002) / FIT * RIM}),
    "snap_hook": (hook, hook_of_peer),
    "gripper": (grip, grip_of_peer),
    "rubber_mount": (mount, lambda folder, refine, _: {"sag": peers.rubber_mount(folder, 2 * refine)}),
    "laid_down": (lies, lambda *_: strip_of_beam()),
}


def run(itr, folder, name, level):
    """One run and its certificate: what happened."""
    make.make(folder, [name], level)
    results = folder / "results" / name
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    studies.run(itr, folder / f"{name}.json", results)
    seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before.ru_utime
    summary = studies.certified(itr, results)
    steps = [json.loads(line) for line in (results / "steps.jsonl").read_text().splitlines()]
    return results, {"level": level, "vertices": steps[-1]["vertices"], "iterations": sum(s["newton_iterations"] for s in steps),
                     "seconds": round(seconds, 1), "warnings": sum(w["count"] for w in summary["warnings"])}


def study(itr, folder, name, levels):
    """A row a level; values that have no reference stand alone."""
    measure, refer = STUDIES[name]
    runs = [run(itr, folder / f"level{level}", name, level) for level in range(levels)]
    reference = refer(folder / "peer", 2**(levels - 1), runs[-1][0])
    for results, row in runs:
        for key, value in measure(results).items():
            row[key] = f"{value:.6g}"
            if key in reference:
                row |= {f"{key}: reference": f"{reference[key]:.6g}",
                        f"{key}: off by [%]": f"{100 * (value / reference[key] - 1):.2f}"}
    return [row for _, row in runs]


def table():
    lines = ["| scene | value | reference | off by [%], on meshes of halved cells | vertices | processor seconds |",
             "|---|---|---|---|---|---|"]
    for name in STUDIES:
        with open(make.HERE / "study" / f"{name}.csv", newline="") as file:
            runs = list(csv.DictReader(file))

        def column(key):
            return ", ".join(row[key] for row in runs)

        for key in [key.removesuffix(": reference") for key in runs[0] if key.endswith(": reference")]:
            lines.append(f"| `{name}` | {key} | {runs[0][f'{key}: reference']} | {column(f'{key}: off by [%]')} | "
                         f"{column('vertices')} | {column('seconds')} |")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=pathlib.Path, default=pathlib.Path("results/assemblies"), help="of runs")
    parser.add_argument("--itr", default="itr")
    parser.add_argument("--levels", type=int, default=3)
    parser.add_argument("scenes", nargs="*", default=list(STUDIES), metavar="SCENE")
    options = parser.parse_args()
    (make.HERE / "study").mkdir(exist_ok=True)
    for name in options.scenes:
        runs = study(options.itr, options.output.resolve(), name, options.levels)
        with open(make.HERE / "study" / f"{name}.csv", "w", newline="") as file:
            writer = csv.DictWriter(file, runs[0], lineterminator="\n")
            writer.writeheader()
            writer.writerows(runs)
        print(name, *runs, sep="\n", flush=True)
    studies.write_table(make.HERE / "README.md", table())


if __name__ == "__main__":
    main()
