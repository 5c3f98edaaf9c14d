# SPDX-License-Identifier: MIT
"""A clamped body of two materials in gravity that is pulled at its end: loads grow over ten quasi-static steps, and all at
once for the law that has a solution to find from anywhere (others may invert on the way)."""
import numpy as np
import ufl
from harness.materials import words
from harness.scenes import run_scene, scene
from harness.suite import Result
from harness.two_bodies import MIXED, two_bodies

TITLE = "Static solutions against FEniCSx"
QUANTITY = "nodal displacement relative to the largest; elastic energy, relative"
REFERENCE = "FEniCSx (dolfinx), same P1, P2 or mixed mesh, Newton to round-off"
TOLERANCE = 1e-9
NEEDS = ("dolfinx", "meshio", "h5py", "scipy")

MESHES = {2: ([20, 6], [1.0, 0.3]), 3: ([8, 3, 3], [1.0, 0.3, 0.3])}
PULL, GRAVITY, STRETCH = [60.0, -10.0, 5.0], -0.3, 0.01  # St. Venant-Kirchhoff inverts under twice as much


def results(context):
    for order in (1, 2, MIXED):
        is_quick = context.quick and order == 2
        yield from results_of(context, order, {2: MESHES[2]} if is_quick else MESHES)


def label(order):
    return "P1 and P2" if order == MIXED else f"P{order}"


def results_of(context, order, meshes):
    for case in two_bodies(context.folder, meshes, order):
        dim, name, body, points = case.dim, case.name, case.body, case.body.nodes
        load = case.load(ufl.as_vector([0, GRAVITY, 0][:dim]), ufl.as_vector(PULL[:dim]))
        held = np.repeat(np.isclose(points[:, 0], 0), dim)
        targets = np.zeros_like(points)
        targets[:, 1] = STRETCH * points[:, 1]
        u = np.zeros(points.size)
        for share in np.linspace(0.1, 1, 10):  # loads step by step, so that Newton finds its way
            u = body.solve(share * load, held, share * targets.ravel(), u)
        for kind in ("quasi-static", "static") if name.startswith("neo") else ("quasi-static",):
            run = run_scene(context, f"{dim}d-{words(label(order))}-{words(name)}-{kind}", scene_of(case, kind))
            ours = run.last().u.ravel()
            yield Result(f"{dim}D, {label(order)}, {name}, {kind}, displacement", float(np.abs(ours - u).max() / np.abs(u).max()),
                         TOLERANCE, note=f"{len(points)} nodes, up to {np.abs(u).max():.3g} m")
            energy = body.energy(u)
            yield Result(f"{dim}D, {label(order)}, {name}, {kind}, elastic energy",
                         abs(run.steps[-1]["energy"]["elastic"] / energy - 1), TOLERANCE)


def scene_of(case, kind):
    dim, share = case.dim, "1" if kind == "static" else "t"
    content = scene(case.mesh, case.materials(), case.discr_order(),
                    boundary_conditions={
                        "rhs": [0, f"{-GRAVITY} * {share}", 0][:dim],
                        "dirichlet_boundary": [{"id": 1, "value": [0, f"{STRETCH} * y * {share}", 0][:dim]}],
                        "neumann_boundary": [{"id": 3, "value": [f"{pull} * {share}" for pull in PULL[:dim]]}]})
    if kind == "quasi-static":
        content["time"] = {"dt": 0.1, "tend": 1, "quasistatic": True}
    return content
