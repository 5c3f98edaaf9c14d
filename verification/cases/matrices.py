# SPDX-License-Identifier: MIT
"""The library's matrices on random states of two bodies grown together, one soft and one stiff."""
import numpy as np
import ufl
from harness.materials import all_laws, words
from harness.probe import matrices
from harness.scenes import scene
from harness.suite import Result
from harness.two_bodies import two_bodies

TITLE = "Matrices and forces entry by entry"
QUANTITY = ("mass matrix, internal force, exact tangent, load vector and energy on random states; entries relative to the "
            "largest of their row (matrices, the smaller of row and column) or vector")
REFERENCE = "FEniCSx (dolfinx): derivatives of the energy by UFL"
TOLERANCE = 1e-12
NEEDS = ("dolfinx", "meshio", "scipy")

MESHES = {2: ([7, 5], [1.4, 1.0]), 3: ([4, 3, 3], [1.2, 0.9, 1.0])}


def random_state(nodes, points, cells, seed, strength):
    """A displacement of `nodes`, which begin with `points`, that leaves every cell at least a tenth of its volume."""
    random = np.random.default_rng(seed)
    gradient = random.uniform(-0.3, 0.3, (points.shape[1],) * 2)
    u = nodes @ gradient + strength * random.standard_normal(nodes.shape)
    while True:
        volumes = [np.linalg.det(p[cells[:, 1:]] - p[cells[:, :1]]) for p in (points, points + u[:len(points)])]
        if (volumes[1] / volumes[0]).min() > 0.1:
            return u
        u *= 0.8


def entry_error(ours, reference):
    """Largest difference of entries, each relative to the largest entry of its row and of its column."""
    largest = np.abs(reference).max(axis=1).toarray().ravel()
    difference = abs(ours - reference).tocoo()
    return (difference.data / np.minimum(largest[difference.row], largest[difference.col])).max()


def vector_error(ours, reference):
    return np.abs(ours - reference).max() / np.abs(reference).max()


STRENGTHS = {1: [0.005, 0.02, 0.05], 2: [0.002, 0.004, 0.008]}  # curved cells invert at corners before their volume ends


def results(context):
    for order in (1, 2):
        yield from results_of(context, order)


def results_of(context, order):
    for case in two_bodies(context.folder, MESHES, order, all_laws):
        dim, name, body = case.dim, case.name, case.body
        x = body.X
        load = case.load(ufl.as_vector([1 + x[0], -9.81 * x[1], 2][:dim]), ufl.as_vector([3e3 * x[1], -4e3, 1e3][:dim]))
        content = scene(case.mesh, case.materials(), order,
                        boundary_conditions={"rhs": ["-1 - x", "9.81 * y", -2][:dim],
                                             "neumann_boundary": [{"id": 3, "value": ["3e3 * y", -4e3, 1e3][:dim]}]})
        errors = {}
        for seed, strength in enumerate(STRENGTHS[order]):
            u = random_state(body.nodes, case.points, case.cells, seed, strength)
            ours = matrices(context, f"{dim}d-p{order}-{words(name)}-{seed}", content, u)
            found = {"mass matrix": entry_error(ours["mass"], body.mass_matrix),
                     "tangent": entry_error(ours["tangent"], body.tangent(u)),
                     "internal force": vector_error(ours["force"], body.internal_force(u)),
                     "load": vector_error(ours["load"], load),
                     "energy": abs(ours["energy"] / body.energy(u) - 1)}
            errors = {key: np.maximum(error, errors.get(key, 0)) for key, error in found.items()}
        for key, error in errors.items():
            yield Result(f"{dim}D, P{order}, {name}, {key}", float(error), TOLERANCE, note="worst of 3 states")
