# SPDX-License-Identifier: MIT
"""A clamped body of two materials in gravity that is pulled at its end: loads grow over ten quasi-static steps, and all at
once for the law that has a solution to find from anywhere (others may invert on the way)."""
import numpy as np
import ufl
from harness.fenicsx import Body
from harness.materials import laws, words
from harness.scenes import box_mesh, run_scene, scene, write_mesh
from harness.suite import Result

TITLE = "Static solutions against FEniCSx"
QUANTITY = "nodal displacement relative to the largest; elastic energy, relative"
REFERENCE = "FEniCSx (dolfinx), same P1 mesh, Newton to round-off"
TOLERANCE = 1e-9
NEEDS = ("dolfinx", "meshio", "h5py", "scipy")

MESHES = {2: ([20, 6], [1.0, 0.3]), 3: ([8, 3, 3], [1.0, 0.3, 0.3])}
PULL, GRAVITY, STRETCH = [60.0, -10.0, 5.0], -0.3, 0.01  # St. Venant-Kirchhoff inverts under twice as much


def results(context):
    for dim, (counts, size) in MESHES.items():
        points, cells = box_mesh(counts, size, jitter=0.25, seed=dim)
        bodies = np.where(points[cells].mean(axis=1)[:, 0] < size[0] / 2, 1, 2)
        mesh = context.folder / f"bar{dim}.msh"
        write_mesh(mesh, points, cells, bodies)
        by_cell = lambda values: np.asarray(values)[bodies - 1]
        for name, law in laws(dim).items():
            parameters = zip(*(law.parameters(material, dim) for material in law.scene))
            rho = by_cell([material["rho"] for material in law.scene])
            body = Body(points, cells, law.density, [by_cell(p) for p in parameters], rho,
                        {3: lambda x: np.isclose(x[0], size[0])})
            gravity = ufl.as_vector([0, GRAVITY, 0][:dim])
            load = body.load(body.coefficient(rho) * ufl.inner(gravity, body.test) * ufl.dx
                             + ufl.inner(ufl.as_vector(PULL[:dim]), body.test) * body.ds(3))()
            held = np.repeat(np.isclose(points[:, 0], 0), dim)
            targets = np.zeros_like(points)
            targets[:, 1] = STRETCH * points[:, 1]
            u = np.zeros(points.size)
            for share in np.linspace(0.1, 1, 10):  # loads step by step, so that Newton finds its way
                u = body.solve(share * load, held, share * targets.ravel(), u)
            for kind in ("quasi-static", "static") if name.startswith("neo") else ("quasi-static",):
                content = scene_of(mesh, law, dim, kind)
                run = run_scene(context, f"{dim}d-{words(name)}-{kind}", content)
                ours = run.last().u.ravel()
                yield Result(f"{dim}D, {name}, {kind}, displacement", float(np.abs(ours - u).max() / np.abs(u).max()),
                             TOLERANCE, note=f"{len(points)} vertices, up to {np.abs(u).max():.3g} m")
                energy = body.energy(u)
                yield Result(f"{dim}D, {name}, {kind}, elastic energy",
                             abs(run.steps[-1]["energy"]["elastic"] / energy - 1), TOLERANCE)


def scene_of(mesh, law, dim, kind):
    share = "1" if kind == "static" else "t"
    content = scene(mesh, [{"id": k + 1, **material} for k, material in enumerate(law.scene)],
                    boundary_conditions={
                        "rhs": [0, f"{-GRAVITY} * {share}", 0][:dim],
                        "dirichlet_boundary": [{"id": 1, "value": [0, f"{STRETCH} * y * {share}", 0][:dim]}],
                        "neumann_boundary": [{"id": 3, "value": [f"{pull} * {share}" for pull in PULL[:dim]]}]})
    if kind == "quasi-static":
        content["time"] = {"dt": 0.1, "tend": 1, "quasistatic": True}
    return content
