# SPDX-License-Identifier: MIT
"""Error bars that runs give themselves, against errors: energy and forces of each step, on scenes of which half were set aside before
anything was tuned (by the hash of their names)."""
import copy
import csv
import hashlib
import json
import math
import pathlib

import numpy as np
from harness.scenes import box_mesh, oriented, run_scene, scene, write_mesh
from harness.suite import Result

TITLE = "Error bars"
QUANTITY = "estimated over true error of energy and of forces, by step; the errors that the mesh makes, and d-hat"
REFERENCE = "the same scene with quadratic elements on a mesh refined once or twice; with an eighth of d-hat"
TOLERANCE = "9 of 10 between 0.5 and 3 in energy, 0.4 and 4 in forces; no bar in at most 15 %"
NEEDS = ("meshio", "h5py")

QUICK = False

ENERGY, FORCE = (0.5, 3), (0.4, 4)
OUTSIDE = 0.1  # share of bars that may be outside
SMALL = 1e-4  # relative errors below it are not told from those of the reference
EXAMPLES = pathlib.Path(__file__).resolve().parent.parent.parent / "examples"
RUBBER = {"type": "NeoHookean", "E": 1e6, "nu": 0.4, "rho": 1000}


def statics(mesh, material, sides, steps=4, **parts):
    """A scene of one mesh with these displacements by side, in steps up to t = 1."""
    content = scene(mesh, material, time={"dt": 1 / steps, "tend": 1, "quasistatic": True},
                    boundary_conditions={"dirichlet_boundary": [{"id": side, **value} for side, value in sides.items()]}, **parts)
    content["solver"]["nonlinear"] = {"max_iterations": 300}
    return content


def clamped(*value):
    return {"value": list(value)}


def curve(**target):
    return {"output": {"forces": [{"name": "force", **target}]}}


def block(context, counts, size, name, bend=None):
    points, cells = box_mesh(counts, size)
    if bend is not None:
        points = bend(points)
        cells = oriented(points, cells)
    path = context.folder / f"{name}.msh"
    write_mesh(path, points, cells)
    return path


def cook(x, y):
    def make(context):
        shape = lambda p: np.stack([p[:, 0], p[:, 0] * 44 / 48 + p[:, 1] * (44 - p[:, 0] * 28 / 48)], axis=1)
        mesh = block(context, [6, 6], [48, 1], "cook", shape)
        content = statics(mesh, {**RUBBER, "nu": 0.3}, {1: clamped(0, 0), 3: clamped(x, y)}, **curve(surfaces=3))
        content["geometry"][0]["surface_selection"] = [{"id": 1, "box": [[-1, -1], [1e-6, 45]]}, {"id": 3, "box": [[47.999, 40], [49, 61]]}]
        return content
    return make


def square(nu, x, y, n=6):
    return lambda context: statics(block(context, [n, n], [1, 1], f"square-{n}"), {**RUBBER, "nu": nu},
                                   {1: clamped(0, 0), 3: clamped(f"{x} * t", f"{y} * t")}, **curve(surfaces=3))


def thin_wall(context):
    return statics(block(context, [30, 2], [10, 0.3], "wall"), {**RUBBER, "nu": 0.3},
                   {1: clamped(0, 0), 3: clamped(0, "0.8 * t")}, **curve(surfaces=3))


def bar(nu, degrees):
    def make(context):
        angle = f"{math.radians(degrees)} * t"
        mesh = block(context, [9, 3, 3], [3, 1, 1], "bar")
        y, z = "(y - 0.5)", "(z - 0.5)"
        turn = [0, f"{y} * (cos({angle}) - 1) - {z} * sin({angle})", f"{y} * sin({angle}) + {z} * (cos({angle}) - 1)"]
        return statics(mesh, {**RUBBER, "nu": nu}, {1: clamped(0, 0, 0), 3: clamped(*turn)},
                       output={"forces": [{"name": "force", "surfaces": 3, "about": [0, 0.5, 0.5]}]})
    return make


def squeezed(context):
    return statics(block(context, [4, 4, 4], [1, 1, 1], "cube"), {**RUBBER, "nu": 0.45},
                   {2: clamped(0, 0, 0), 4: clamped(0, "-0.2 * t", 0)}, **curve(surfaces=4))


def line(context, name, points):
    path = context.folder / f"{name}.obj"
    path.write_text("".join(f"v {x:.17g} {y:.17g} 0\n" for x, y in points) +
                    "".join(f"l {k + 1} {k + 2}\n" for k in range(len(points) - 1)))
    return path


def with_obstacles(content, obstacles, dhat, friction=0.0):
    """`obstacles`: mesh, id and displacement of each."""
    content["contact"] = {"enabled": True, "dhat": dhat, "use_convergent_formulation": True,
                          **({"friction_coefficient": friction, "epsv": 1e-4} if friction else {})}
    if friction:
        content["solver"]["contact"] = {"friction_iterations": 10}
    for path, number, motion in obstacles:
        content["geometry"].append({"mesh": str(path), "is_obstacle": True, "surface_selection": number})
        if motion:
            content["boundary_conditions"].setdefault("obstacle_displacements", []).append({"id": number, "value": motion})
    return content


def pressed_block(friction, n=6):
    """A block on a line, pressed by a narrower one with rounded corners."""
    def make(context):
        content = statics(block(context, [2 * n, n], [2, 1], f"block-{n}"), RUBBER, {2: clamped(0, 0)}, **curve(obstacles=21))
        stamp = [(0.5, 1.6), (0.5, 1.151), (0.55, 1.051), (0.65, 1.001), (1.35, 1.001), (1.45, 1.051), (1.5, 1.151), (1.5, 1.6)]
        shear = "0.08 * t" if friction else 0
        return with_obstacles(content, [(line(context, "stamp", stamp), 21, [shear, "-0.12 * t"])], 2e-3, friction)
    return make


def disc_mesh(context, n=8):
    def shape(p):
        q = 2 * p - 1
        radius, longest = np.abs(q).max(axis=1), np.linalg.norm(q, axis=1)
        return q * np.where(longest > 0, radius / np.maximum(longest, 1e-12), 1)[:, None]
    return block(context, [n, n], [1, 1], f"disc-{n}", shape)


def disc(depth, friction=0.0):
    """A disc between two plates."""
    def make(context):
        content = statics(disc_mesh(context), RUBBER, {}, **curve(obstacles=22))
        content["boundary_conditions"]["dirichlet_boundary"] = []
        plates = [(line(context, "below", [(-3, -1.002), (3, -1.002)]), 21, None),
                  (line(context, "above", [(-3, 1.002), (3, 1.002)]), 22, [0, f"-{depth} * t"])]
        return with_obstacles(content, plates, 5e-3, friction or 0.3)
    return make


def half_ring(context):
    """A half ring on its clamped feet, pressed by a plate."""
    def shape(p):
        angle, radius = np.pi * (1 - p[:, 0] / 20), 1 + 0.2 * p[:, 1]
        return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    content = statics(block(context, [20, 2], [20, 1], "ring", shape), {**RUBBER, "nu": 0.3}, {1: clamped(0, 0)}, **curve(obstacles=21))
    content["geometry"][0]["surface_selection"] = [{"id": 1, "box": [[-2, -1], [2, 1e-6]]}]
    return with_obstacles(content, [(line(context, "plate", [(-3, 1.203), (3, 1.203)]), 21, [0, "-0.2 * t"])], 5e-3)


def hook(context):
    """A beam whose end a ramp lifts."""
    content = statics(block(context, [24, 2], [6, 0.5], "hook"), {**RUBBER, "nu": 0.3}, {1: clamped(0, 0)}, **curve(obstacles=21))
    ramp = [(5.6 + math.cos(a), -1.004 + math.sin(a)) for a in np.linspace(np.pi, 0, 33)]
    return with_obstacles(content, [(line(context, "ramp", ramp), 21, [0, "0.5 * t"])], 4e-3)


def punch_3d(context):
    """A cube pressed by a smaller plate."""
    content = statics(block(context, [4, 4, 4], [1, 1, 1], "cube"), RUBBER, {2: clamped(0, 0, 0)}, **curve(obstacles=21))
    path = context.folder / "plate.obj"
    path.write_text("v 0.2 1.006 0.2\nv 0.8 1.006 0.2\nv 0.8 1.006 0.8\nv 0.2 1.006 0.8\nf 1 3 2\nf 1 4 3\n")
    return with_obstacles(content, [(path, 21, [0, "-0.1 * t", 0])], 1e-2)


def falling(context):
    """A square that falls onto a line, dynamic."""
    content = statics(block(context, [6, 6], [1, 1], "square-6"), {**RUBBER, "E": 1e5}, {}, **curve(obstacles=21))
    content["boundary_conditions"] = {"rhs": [0, 9.81]}
    content["time"] = {"dt": 0.01, "tend": 0.1, "integrator": "BDF2"}
    content["initial_conditions"] = {"velocity": [{"id": 1, "value": [0.3, -1]}]}
    return with_obstacles(content, [(line(context, "floor", [(-3, -0.011), (4, -0.013)]), 21, None)], 5e-3)


def swinging(context):
    """A beam that swings, dynamic."""
    content = statics(block(context, [16, 2], [4, 0.5], "beam"), {**RUBBER, "nu": 0.3}, {1: clamped(0, 0)}, **curve(surfaces=1))
    content["boundary_conditions"]["rhs"] = [0, 9.81]
    content["time"] = {"dt": 0.01, "tend": 0.1, "integrator": "BDF2"}
    return content


# Name: scene, order of elements, refinements of the reference.
SCENES = {
    "cook pulled": (cook(0, "8 * t"), 1, 2), "cook pulled, P2": (cook(0, "8 * t"), 2, 2),
    "cook stretched": (cook("10 * t", 0), 1, 2),
    "square sheared": (square(0.3, 0.1, 0.2), 1, 2), "square sheared, P2": (square(0.3, 0.1, 0.2), 2, 2),
    "square, nu 0.45": (square(0.45, 0.3, 0), 1, 2), "square, nu 0.49, P2": (square(0.49, 0.2, 0), 2, 2),
    "thin wall": (thin_wall, 1, 2), "thin wall, P2": (thin_wall, 2, 2),
    "bar twisted": (bar(0.3, 60), 1, 1), "bar twisted, nu 0.45": (bar(0.45, 60), 1, 1), "bar twisted, P2": (bar(0.3, 60), 2, 1),
    "cube squeezed": (squeezed, 1, 1),
    "block pressed": (pressed_block(0), 1, 2), "block pressed, P2": (pressed_block(0), 2, 2),
    "block pressed, friction": (pressed_block(0.3), 1, 2), "block pressed, fine": (pressed_block(0, 12), 1, 2),
    "disc between plates": (disc(0.15), 1, 2), "disc between plates, P2": (disc(0.15), 2, 1),
    "half ring": (half_ring, 1, 2), "half ring, P2": (half_ring, 2, 2),
    "hook": (hook, 1, 2), "hook, P2": (hook, 2, 1),
    "punch 3D": (punch_3d, 1, 1),
    "square falling": (falling, 1, 2), "beam swinging": (swinging, 1, 2), "beam swinging, P2": (swinging, 2, 1),
}


def is_set_aside(name):
    return hashlib.sha1(name.encode()).digest()[0] % 2 == 1


class Curve:
    """By step after the first: energies, forces with moments, and their bars by source; None where there is none."""

    def __init__(self, run):
        steps = run.steps[1:]
        self.energy = [step["energy"]["total"] for step in steps]
        self.size = [step["energy"]["elastic"] + step["energy"]["contact"] + step["energy"]["inertia"] for step in steps]
        self.bars = [step.get("bars", {}).get("energy") for step in steps]
        self.reasons = [step.get("bars", {}).get("no_bar", "") for step in steps]
        self.seconds = sum(step["processor_seconds"] for step in steps)
        with open(run.folder / "forces.csv") as file:
            rows = [row for row in csv.DictReader(file)][1:]
        axes = [axis for axis in ("x", "y", "z") if f"all_{axis}" in rows[0]]
        if any("mx" in key for key in rows[0]):
            axes.append("mx")  # of twisted bars
        self.force = np.array([[float(row[f"all_{axis}"]) for axis in axes] for row in rows])
        self.force_error = lambda source: [
            None if not row.get(f"all_x_error_{source}") else np.array([float(row[f"all_{axis}_error_{source}"]) for axis in axes])
            for row in rows]


def run_as(context, name, content, order, refinements, dhat_factor=1.0, bars=True):
    content = copy.deepcopy(content)
    content["geometry"][0]["n_refs"] = refinements
    content["space"] = {"discr_order": order}
    content["output"]["error_bars"] = bars
    content["output"]["paraview"] = {"skip_frame": 1000}
    if dhat_factor != 1:
        content["contact"]["dhat"] *= dhat_factor
    return Curve(run_scene(context, name, content))


def rows_of(name, source, run, energies, forces):
    """A row for each step and quantity whose error can be told: scene, half, source, step, quantity, true error and estimate, relative."""
    half = "aside" if is_set_aside(name) else "tuning"
    for k, _ in enumerate(run.energy):
        true, size = energies[k] - run.energy[k], run.size[k]
        if size > 0 and abs(true) > SMALL * size:
            bar = run.bars[k]
            yield [name, half, source, k + 1, "energy", f"{true / size:.3e}", f"{bar[source] / size:.3e}" if bar else run.reasons[k]]
        true, size = forces[k] - run.force[k], np.linalg.norm(run.force[k])
        if size > 0 and np.linalg.norm(true) > SMALL * size:
            bar = run.force_error(source)[k]
            along = true / np.linalg.norm(true)
            yield [name, half, source, k + 1, "force", f"{np.linalg.norm(true) / size:.3e}",
                   f"{bar @ along / size:.3e}" if bar is not None else run.reasons[k]]


def ratio(row):
    try:
        return float(row[6]) / float(row[5])
    except ValueError:
        return None


def judge(rows, half):
    for quantity, (low, high) in (("energy", ENERGY), ("force", FORCE)):
        chosen = [row for row in rows if row[1] == half and row[4] == quantity]
        ratios = [ratio(row) for row in chosen]
        known = [r for r in ratios if r is not None]
        hits = sum(low <= r <= high for r in known)
        yield quantity, len(chosen), len(known), hits


def results(context):
    table, costs = [], []
    for name, (make, order, refinements) in SCENES.items():
        content = make(context)
        short = name.replace(" ", "-").replace(",", "")
        run = run_as(context, short, content, order, 0)
        reference = run_as(context, f"{short}-reference", content, 2, refinements, bars=False)
        table += rows_of(name, "mesh", run, reference.energy, reference.force)
        if content["contact"]["enabled"]:
            nearer = run_as(context, f"{short}-dhat", content, order, 0, 1 / 8, bars=False)
            extrapolate = lambda near, here: [a + (a - b) / 7 for a, b in zip(near, here)]
            table += rows_of(name, "dhat", run, extrapolate(nearer.energy, run.energy), extrapolate(nearer.force, run.force))
        without = run_as(context, f"{short}-without", content, order, 0, bars=False)
        costs.append([name, run.seconds / without.seconds - 1])
    header = ["scene", "half", "source", "step", "quantity", "true", "estimate or why there is none"]
    context.table("bars", header, [[*row[:-1], json.dumps(row[-1]) if "," in row[-1] else row[-1]] for row in table])
    context.table("cost", ["scene", "processor seconds of bars over those of the run without"], [[json.dumps(n), f"{c:.3f}"] for n, c in costs])
    for half in ("tuning", "aside"):
        for quantity, asked, known, hits in judge(table, half):
            if known == 0:
                continue
            yield Result(f"{half}: share of bars on the {quantity} outside of the bounds", 1 - hits / known, OUTSIDE,
                         note=f"{hits} of {known} inside; no bar for {asked - known} of {asked}")
    yield Result("processor seconds of bars over those of the run without, median", float(np.median([c for _, c in costs])), None)
