# SPDX-License-Identifier: MIT
"""A stiff die with a round foot, pressed into a block and drawn over it (shallow ironing, Fischer & Wriggers), and a ring that turns
in a bore, plane strain, linear elements, by ITR's defaults: coarse polygons nest into each other, averaged gaps let them slide.
Lengths in m, forces in N/m."""
import csv

import numpy as np
from harness.scenes import run_scene, write_mesh
from harness.suite import Result, compare

TITLE = "Coarse surfaces that slide"
QUANTITY = "mean forces on the die while it slides, t from 2 on; torque of the ring"
REFERENCE = "quadratic elements, h 0.1 and 0.025 on the die: horizontal 1.83e8, vertical 5.10e8 N/m"
TOLERANCE = "averaged gaps: 3 % at h 0.2, 1 % at h 0.1; frictionless: horizontal below 1 % of vertical; torque constant to 0.1 %"
NEEDS = ("meshio",)

WIDTH, HEIGHT, RADIUS, FOOT, TOP, GAP = 12.0, 4.0, 0.75, 1.2, 1.5, 2e-3
ALONG, DOWN = 1.83e8, 5.10e8
SLIDES_FROM = 2.0


def grid(counts):
    """Points of the unit square and triangles whose diagonals alternate."""
    nx, ny = counts
    points = np.array([(i / nx, j / ny) for j in range(ny + 1) for i in range(nx + 1)])
    cells = []
    for j in range(ny):
        for i in range(nx):
            a = j * (nx + 1) + i
            b, c, d = a + 1, a + nx + 2, a + nx + 1
            cells += [(a, b, c), (a, c, d)] if (i + j) % 2 == 0 else [(a, b, d), (b, c, d)]
    return points, np.array(cells)


def die(h, height, gap):
    """Between the round foot and the flat top of a die at x = 2."""
    half = np.arcsin(FOOT / 2 / RADIUS)
    points, cells = grid([max(4, round(2 * half * RADIUS / h)), max(3, round(FOOT / h))])
    angle = (2 * points[:, 0] - 1) * half
    foot = np.stack([RADIUS * np.sin(angle), RADIUS * (1 - np.cos(angle))], axis=1)
    top = np.stack([FOOT * (points[:, 0] - 0.5), np.full(len(points), height)], axis=1)
    points = foot + points[:, 1:] * (top - foot) + [2, HEIGHT + gap]
    return points, cells


def ironing_scene(folder, name, h, h_die, averages="auto", friction=0.3, height=TOP, gap=GAP):
    """Meshes in the folder, and the scene."""
    points, cells = grid([round(WIDTH / h), round(HEIGHT / h)])
    for body, (points, cells) in (("base", (points * [WIDTH, HEIGHT], cells)), ("die", die(h_die, height, gap))):
        write_mesh(folder / f"{name}-{body}.msh", points, cells, np.full(len(cells), 1 + (body == "die")))
    low, high = [[-1, -1], [WIDTH + 1, 1e-6]], [[0, HEIGHT + gap + height - 1e-6], [WIDTH, 2 * HEIGHT]]
    return {
        "defaults": "itr",
        "geometry": [{"mesh": str(folder / f"{name}-{body}.msh"), "volume_selection": k, "surface_selection": [{"id": k, "box": box}]}
                     for body, k, box in (("base", 1, low), ("die", 2, high))],
        "materials": [{"id": k, "type": "NeoHookean", "E": young, "nu": 0.32, "rho": 1, "plane_strain": True}
                      for k, young in ((1, 6.896e8), (2, 6.896e9))],
        "boundary_conditions": {"dirichlet_boundary": [{"id": 1, "value": [0, 0]}, {"id": 2, "value": ["2*max(t-1,0)", "-min(t,1)"]}]},
        "contact": {"enabled": True, "friction_coefficient": friction, "average_gaps": averages},
        "time": {"dt": 0.05, "tend": 5, "quasistatic": True},
        "output": {"forces": [{"name": "die", "surfaces": 2}], "paraview": {"skip_frame": 20}}}


def iron(context, name, h, h_die, averages="auto", friction=0.3):
    content = ironing_scene(context.folder, name, h, h_die, averages, friction)
    run = run_scene(context, name, content)
    with open(run.folder / "forces.csv", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if row["name"] == "die"]
    forces = np.array([[float(row[key]) for key in ("t", "reaction_x", "reaction_y")] for row in rows])
    forces = forces[forces[:, 0] >= SLIDES_FROM - 1e-9]
    context.call("itr", "certify", run.folder)
    iterations = sum(step["newton_iterations"] for step in run.steps)
    return Ironed(forces[:, 1], -forces[:, 2], iterations, sum(step["processor_seconds"] for step in run.steps))


def ring(inner, outer, around, through, turn=0.0):
    angle = 2 * np.pi * np.arange(around) / around + turn
    radius = np.linspace(inner, outer, through + 1)
    points = np.stack([np.outer(radius, np.cos(angle)), np.outer(radius, np.sin(angle))], axis=-1).reshape(-1, 2)
    cells = []
    for i in range(through):
        for j in range(around):
            a, b = i * around + j, i * around + (j + 1) % around
            c, d = b + around, a + around
            cells += [(a, d, c), (a, c, b)] if (i + j) % 2 else [(a, d, b), (b, d, c)]
    return points, np.array(cells)


def torques(context, around):
    """Of a ring of 24 edges that is widened and turned in a bore of `around` edges, over two of its edges."""
    for body, mesh in (("ring", ring(0.5, 0.995, 24, 4)), ("bore", ring(1.0, 1.6, around, 5, 0.01))):
        write_mesh(context.folder / f"{body}-{around}.msh", *mesh, np.full(len(mesh[1]), 1 + (body == "bore")))
    turn, widen = "(0.02*max(t-1,0))", "(1+0.05*min(t,1))"
    content = {
        "defaults": "itr",
        "geometry": [{"mesh": str(context.folder / f"{body}-{around}.msh"), "volume_selection": k,
                      "surface_selection": selection}
                     for body, k, selection in (("ring", 1, [{"id": 1, "center": [0, 0], "radius": 0.7}]),
                                                ("bore", 2, [{"id": 3, "center": [0, 0], "radius": 1.1}, {"id": 2, "box": [[-2, -2], [2, 2]]}]))],
        "materials": [{"id": k, "type": "NeoHookean", "E": k * 1e6, "nu": 0.3, "rho": 1, "plane_strain": True} for k in (1, 2)],
        "boundary_conditions": {"dirichlet_boundary": [
            {"id": 1, "value": [f"x*(cos{turn}*{widen}-1)-y*sin{turn}*{widen}", f"x*sin{turn}*{widen}+y*(cos{turn}*{widen}-1)"]},
            {"id": 2, "value": [0, 0]}]},
        "contact": {"enabled": True, "friction_coefficient": 0.2},
        "time": {"dt": 0.5, "tend": 28, "quasistatic": True},
        "output": {"forces": [{"name": "ring", "surfaces": 1}], "paraview": {"skip_frame": 20}}}
    run = run_scene(context, f"bore-{around}", content)
    with open(run.folder / "forces.csv", encoding="utf-8") as file:
        return np.array([float(row["reaction_moment"]) for row in csv.DictReader(file) if float(row["t"]) > 10])


class Ironed:
    def __init__(self, along, down, iterations, seconds):
        self.along, self.down, self.iterations, self.seconds = along.mean(), down.mean(), iterations, seconds
        windows = np.lib.stride_tricks.sliding_window_view(along, 3)  # of an edge of 0.2
        self.ripple = np.ptp(windows, axis=1).mean() / abs(self.along)
        self.note = (f"{iterations} Newton iterations, {seconds:.1f} processor seconds; horizontal from lowest to highest over an edge "
                     f"{100 * self.ripple:.1f} %")


def results(context):
    rows = []

    def held(label, run, along, down):
        rows.append([label, f"{run.along:.5g}", f"{run.down:.5g}", f"{run.ripple:.3f}", run.iterations, f"{run.seconds:.1f}"])
        yield compare(f"{label}: horizontal [N/m]", run.along, ALONG, along, run.note)
        yield compare(f"{label}: vertical [N/m]", run.down, DOWN, down)

    for around in (24,) if context.quick else (24, 30):
        torque = torques(context, around)
        yield Result(f"ring in a bore of {around} edges: torque from lowest to highest, over its mean", np.ptp(torque) / abs(torque.mean()),
                     0.001, note=f"mean {torque.mean():.6g} N")
    yield from held("averaged, h 0.2", iron(context, "averaged-0.2", 0.2, 0.2), 0.03, 0.03)
    if not context.quick:
        yield from held("plain, h 0.2", iron(context, "plain-0.2", 0.2, 0.2, False), None, None)
        yield from held("averaged, h 0.2, die 0.13", iron(context, "averaged-0.2-0.13", 0.2, 0.13), 0.03, 0.03)
        yield from held("averaged, h 0.1", iron(context, "averaged-0.1", 0.1, 0.1), 0.01, 0.01)
        smooth = iron(context, "frictionless", 0.2, 0.2, True, friction=0)
        yield Result("frictionless: horizontal over vertical", abs(smooth.along) / smooth.down, 0.01, note=smooth.note)
        context.table("runs", ["run", "horizontal", "vertical", "ripple", "iterations", "processor seconds"], rows)
