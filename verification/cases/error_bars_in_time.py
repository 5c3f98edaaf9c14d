# SPDX-License-Identifier: MIT
"""Bars of the time step, against runs of the same mesh with a sixteenth of the step: displacements and forces of each step, over one
period of a scene and over ten. Half of the scenes is set aside by the hash of their names."""
import copy
import csv
import math

import numpy as np
from harness.scenes import run_scene
from harness.suite import Result

from cases.error_bars import FORCE, OUTSIDE, RUBBER, block, clamped, curve, is_set_aside, line, ratio, statics, with_obstacles

TITLE = "Error bars of time steps"
QUANTITY = "estimated over true error of a force and of a displacement, by step; what the length of the steps makes of it"
REFERENCE = "the same scene with a sixteenth of the step"
TOLERANCE = "9 of 10 between 0.4 and 4; no bar in at most 15 %"
NEEDS = ("meshio", "h5py")

QUICK = False

FINER = 16
SMALL = 1e-3  # errors below it, of the largest value of the run, are not told from those of the reference
SOFT = {**RUBBER, "E": 1e5, "nu": 0.3}


def swings(content, integrator, dt, steps, point, velocity=None):
    content["time"] = {"dt": dt, "tend": dt * steps, "integrator": integrator}
    content["output"]["points"] = [{"name": "point", "rest": point}]
    if velocity:
        content["initial_conditions"] = {"velocity": [{"id": 1, "value": velocity}]}
    return content


def beam(integrator, steps, size=1.0, gravity=0.0, dt=0.02):
    """A cantilever that is struck; its slowest period is about 1.3 s."""
    def make(context):
        content = statics(block(context, [12, 2], [2, 0.25], "beam"), SOFT, {1: clamped(0, 0)}, **curve(surfaces=1))
        content["boundary_conditions"]["rhs"] = [0, gravity]
        return swings(content, integrator, dt, steps, [2, 0.125], [0, f"{size} * x * x / 4"])
    return make


def bar(integrator, steps):
    """A bar in 3D that is struck in two directions and turned."""
    def make(context):
        content = statics(block(context, [6, 2, 2], [1.2, 0.3, 0.3], "bar"), SOFT, {1: clamped(0, 0, 0)}, **curve(surfaces=1))
        return swings(content, integrator, 0.01, steps, [1.2, 0.15, 0.15], [0, "0.5 * x * x - 2 * x * (z - 0.15)", "0.3 * x * x + 2 * x * (y - 0.15)"])
    return make


def shaken(integrator, steps):
    """A block on a floor that is shaken."""
    def make(context):
        content = statics(block(context, [4, 6], [0.5, 0.75], "block"), SOFT, {2: clamped("0.05 * (1 - cos(6 * t))", 0)}, **curve(surfaces=2))
        return swings(content, integrator, 0.02, steps, [0.25, 0.75])
    return make


def spinning(integrator, steps):
    """A free square that turns and swings."""
    def make(context):
        content = statics(block(context, [4, 4], [1, 1], "square"), SOFT, {}, output={"forces": [{"name": "force", "surfaces": 1}]})
        content["boundary_conditions"] = {}
        return swings(content, integrator, 0.01, steps, [1, 1], ["-2 * (y - 0.5) + x", "2 * (x - 0.5)"])
    return make


def hung(integrator, steps):
    """A strip that hangs, is let go, and swings like a pendulum."""
    def make(context):
        content = statics(block(context, [12, 1], [1.2, 0.1], "strip"), {**SOFT, "E": 1e6}, {1: clamped(0, 0)}, **curve(surfaces=1))
        content["boundary_conditions"]["rhs"] = [0, 9.81]
        return swings(content, integrator, 0.02, steps, [1.2, 0.05])
    return make


def pressed_slide(integrator, steps):
    """A block that a plate presses gently and drags."""
    def make(context):
        content = statics(block(context, [6, 3], [1, 0.5], "pad"), SOFT, {2: clamped(0, 0)}, **curve(obstacles=21))
        ramp = f"(1 - cos({math.pi} * min(t, 1))) / 2"
        content = with_obstacles(content, [(line(context, "plate", [(-2, 0.504), (3, 0.504)]), 21, [f"0.3 * {ramp}", f"-0.05 * {ramp}"])], 5e-3, 0.3)
        return swings(content, integrator, 0.02, steps, [0.5, 0.25])
    return make


# One period, and ten where a name says so.
SCENES = {
    "beam, BDF2": beam("BDF2", 65), "beam, Newmark": beam("ImplicitNewmark", 65), "beam, Euler": beam("ImplicitEuler", 65),
    "beam, BDF2, ten": beam("BDF2", 650), "beam, Newmark, ten": beam("ImplicitNewmark", 650),
    "beam, Euler, ten": beam("ImplicitEuler", 650, dt=0.005),
    "beam bent far, BDF2": beam("BDF2", 65, 4), "beam under its weight, Newmark": beam("ImplicitNewmark", 65, 0, 2),
    "bar, BDF2": bar("BDF2", 60), "bar, Newmark": bar("ImplicitNewmark", 60), "bar, BDF2, ten": bar("BDF2", 400),
    "shaken, BDF2": shaken("BDF2", 60), "shaken, Newmark": shaken("ImplicitNewmark", 60), "shaken, Euler": shaken("ImplicitEuler", 60),
    "shaken, BDF2, ten": shaken("BDF2", 500),
    "spinning, BDF2": spinning("BDF2", 100), "spinning, Newmark": spinning("ImplicitNewmark", 100),
    "pendulum, BDF2": hung("BDF2", 60), "pendulum, Newmark": hung("ImplicitNewmark", 60), "pendulum, Euler": hung("ImplicitEuler", 60),
    "pressed and dragged, BDF2": pressed_slide("BDF2", 75), "pressed and dragged, Newmark": pressed_slide("ImplicitNewmark", 75),
}


def read(path, prefix):
    """Vectors and their bars in time by step after the first; None where there is none."""
    with open(path) as file:
        rows = list(csv.DictReader(file))
    rows = [row for row in rows if float(row["t"]) > 0]
    axes = [axis for axis in "xyz" if f"{prefix}{axis}" in rows[0]]
    values = np.array([[float(row[f"{prefix}{axis}"]) for axis in axes] for row in rows])
    bars = [np.array([float(row[f"{prefix}{axis}_error_time"]) for axis in axes]) if row.get(f"{prefix}x_error_time") else None for row in rows]
    return values, bars


def run_as(context, name, content, finer, bars):
    content = copy.deepcopy(content)
    content["time"]["dt"] /= finer
    content["output"]["error_bars"] = bars
    content["output"]["paraview"] = {"skip_frame": 100000}
    run = run_scene(context, name, content)
    return {"force": read(run.folder / "forces.csv", "all_"), "displacement": read(run.folder / "points.csv", "u_")}


def rows_of(name, run, reference):
    half = "aside" if is_set_aside(name) else "tuning"
    for quantity, (values, bars) in run.items():
        exact = reference[quantity][0][FINER - 1::FINER]
        size = np.linalg.norm(exact, axis=1).max()
        if size == 0:
            continue
        for k, (value, bar) in enumerate(zip(values, bars)):
            true = exact[k] - value
            if np.linalg.norm(true) > SMALL * size:
                along = true / np.linalg.norm(true)
                yield [name, half, k + 1, quantity, "", f"{np.linalg.norm(true) / size:.3e}", f"{bar @ along / size:.3e}" if bar is not None else ""]


def results(context):
    table = []
    for name, make in SCENES.items():
        content = make(context)
        short = name.replace(" ", "-").replace(",", "")
        run = run_as(context, short, content, 1, True)
        table += rows_of(name, run, run_as(context, f"{short}-reference", content, FINER, False))
    context.table("bars", ["scene", "half", "step", "quantity", "true", "estimate; empty: no bar"],
                  [[f'"{row[0]}"', *row[1:4], *row[5:]] for row in table])
    for half in ("tuning", "aside"):
        for quantity in ("force", "displacement"):
            chosen = [row for row in table if row[1] == half and row[3] == quantity]
            ratios = [r for r in map(ratio, chosen) if r is not None]
            hits = sum(FORCE[0] <= r <= FORCE[1] for r in ratios)
            yield Result(f"{half}: share of bars on the {quantity} outside of the bounds", 1 - hits / len(ratios), OUTSIDE,
                         note=f"{hits} of {len(ratios)} inside; no bar for {len(chosen) - len(ratios)} of {len(chosen)}")
