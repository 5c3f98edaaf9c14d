# SPDX-License-Identifier: MIT
"""A clamped box in gravity that is pulled at its end, on the mesh of mixed order that remeshing has chosen: some edges split,
some curved. FEniCSx solves on the stored mesh, where the nodes of straight edges are the means of their ends."""
import numpy as np
import ufl
from harness.fenicsx import Body
from harness.materials import lame, neo_hookean
from harness.scenes import box_mesh, is_of_mixed_order, run_scene, scene, write_mesh
from harness.suite import Result

TITLE = "Static solutions on meshes of adapted order against FEniCSx"
QUANTITY = "nodal displacement relative to the largest; elastic energy, relative"
REFERENCE = "FEniCSx (dolfinx), P2 on the stored mesh with its straight edges, Newton to round-off"
TOLERANCE = 1e-9
NEEDS = ("dolfinx", "meshio", "h5py", "scipy")

# Counts of cells, size, tolerances [J] of splits and of curved edges.
CASES = {2: ([6, 2], [1.0, 0.3], 1e-2, 1e-2), 3: ([4, 2, 2], [1.0, 0.3, 0.3], 2e-3, 2e-3)}
MATERIAL = {"type": "NeoHookean", "E": 2e4, "nu": 0.35, "rho": 1000.0}
PULL, GRAVITY, PULLED = [400.0, -60.0, 30.0], -0.3, 3


def results(context):
    for dim, (counts, size, split, curve) in CASES.items():
        points, cells = box_mesh(counts, size, jitter=0.2, seed=dim)
        mesh = context.folder / f"box{dim}.msh"
        write_mesh(mesh, points, cells)
        content = scene(mesh, {"id": 1, **MATERIAL},
                        boundary_conditions={"rhs": [0, -GRAVITY, 0][:dim],
                                             "dirichlet_boundary": [{"id": 1, "value": [0] * dim}],
                                             "neumann_boundary": [{"id": PULLED, "value": PULL[:dim]}]},
                        space={"remesh": {"enabled": True, "split": {"acceptance_tolerance": split},
                                          "curve": {"enabled": True, "acceptance_tolerance": curve}}})
        run = run_scene(context, f"box-{dim}d", content)
        last, frame = run.steps[-1], run.last()
        chosen = f"{last['splits']['accepted']} splits, {last['curves']['accepted']} curved edges"
        mixed = is_of_mixed_order(frame) and last["splits"]["accepted"] > 0
        yield Result(f"{dim}D: edges that are not curved or not split", float(not mixed), 0,
                     note=chosen)
        vertices = frame.rest[:len(frame.rest) - len(frame.curved)]
        body = Body(vertices, frame.cells, neo_hookean, lame(MATERIAL["E"], MATERIAL["nu"], dim), MATERIAL["rho"],
                    {PULLED: lambda x: np.isclose(x[0], size[0])}, 2, frame.curved)
        load = body.load(MATERIAL["rho"] * ufl.inner(ufl.as_vector([0, GRAVITY, 0][:dim]), body.test) * ufl.dx
                         + ufl.inner(ufl.as_vector(PULL[:dim]), body.test) * body.ds(PULLED))()
        held = np.repeat(np.isclose(body.nodes[:, 0], 0), dim)
        u = np.zeros(body.nodes.size)
        for share in np.linspace(0.1, 1, 10):
            u = body.solve(share * load, held, np.zeros(body.nodes.size), u)
        ours = frame.u.ravel()
        yield Result(f"{dim}D, displacement", float(np.abs(ours - u).max() / np.abs(u).max()), TOLERANCE,
                     note=f"{len(body.nodes)} nodes, up to {np.abs(u).max():.3g} m")
        yield Result(f"{dim}D, elastic energy", abs(last["energy"]["elastic"] / body.energy(u) - 1), TOLERANCE)
