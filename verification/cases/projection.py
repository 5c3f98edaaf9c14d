# SPDX-License-Identifier: MIT
"""The density-weighted L2 projection on nested meshes (refined and coarsened locally) and on unrelated ones."""
import numpy as np
from harness import probe
from harness.projection import Projection
from harness.refinement import refine_some
from harness.scenes import box_mesh, oriented, scene, write_mesh
from harness.suite import Result

TITLE = "L2 projection between meshes"
QUANTITY = "nodal values of the projection of a random field, relative to the largest; momentum, relative"
REFERENCE = "FEniCSx mass matrices on the new mesh and on the common refinement, which Python cuts"
TOLERANCE = 1e-10
NEEDS = ("dolfinx", "meshio", "scipy")

RHO = [900.0, 7800.0]
SIZE = {2: [1.0, 0.7], 3: [1.0, 0.7, 0.8]}


def meshes(dim, quick):
    """Pairs of (points, cells, body of each cell) by name. Bodies meet along cells' sides in nested meshes; unrelated
    meshes have only one."""
    n = ([8, 6] if quick else [16, 12]) if dim == 2 else ([3, 2, 2] if quick else [5, 4, 4])
    points, cells = box_mesh(n, SIZE[dim], jitter=0.25, seed=1)
    middle = points[cells].mean(axis=1)
    bodies = np.where(middle[:, 0] < SIZE[dim][0] / 2, 1, 2)
    near = np.flatnonzero(np.linalg.norm(middle - np.array(SIZE[dim]) / 3, axis=1) < 0.3)
    refined, fine_cells, parents = refine_some(points, cells, near)
    fine = refined, oriented(refined, fine_cells), bodies[parents]
    coarse = points, cells, bodies
    other = box_mesh([k + 1 for k in n], SIZE[dim], jitter=0.25, seed=2)
    uniform = lambda mesh: (*mesh, np.ones(len(mesh[1]), dtype=int))
    return {"nested, refined": (coarse, fine), "nested, coarsened": (fine, coarse),
            "not nested": (uniform((points, cells)), uniform(other))}


def results(context):
    for dim in (2, 3):
        for name, pair in meshes(dim, context.quick).items():
            words = f"{dim}d-" + name.replace(", ", "-").replace(" ", "-")
            contents, density = [], []
            for kind, (points, cells, bodies) in zip(("old", "new"), pair):
                mesh = context.folder / f"{words}-{kind}.msh"
                write_mesh(mesh, points, cells, bodies)
                contents.append(scene(mesh, [{"type": "NeoHookean", "E": 1e5, "nu": 0.3, "rho": rho, "id": k + 1}
                                             for k, rho in enumerate(RHO)]))
                density.append(np.array(RHO)[bodies - 1])
            old, new = (mesh[:2] for mesh in pair)
            field = np.random.default_rng(7).standard_normal((len(old[0]), dim))
            ours = probe.project(context, words, *contents, field)
            projection = Projection(old, new, *density)
            expected = projection(field)
            assert abs(projection.covered - 1) < 1e-12, projection.covered
            note = f"{len(old[0])} -> {len(new[0])} vertices"
            yield Result(f"{dim}D, {name}, values", float(np.abs(ours - expected).max() / np.abs(expected).max()),
                         TOLERANCE, note=note)
            change = projection.integral_new(ours) - projection.integral_old(field)
            scale = projection.integral_old(np.abs(field))
            yield Result(f"{dim}D, {name}, momentum", float(np.abs(change / scale).max()), TOLERANCE)
