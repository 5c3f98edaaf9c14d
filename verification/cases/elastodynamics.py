# SPDX-License-Identifier: MIT
"""Neo-Hookean bodies with a moving end, gravity, a traction that grows and an initial spin, 50 steps."""
import numpy as np
import ufl
from dolfinx import fem
from harness.dynamics import integrate
from harness.fenicsx import Body
from harness.materials import lame, neo_hookean
from harness.scenes import box_mesh, run_scene, scene, write_mesh
from harness.suite import Result
from petsc4py import PETSc

TITLE = "Elastodynamics against FEniCSx"
QUANTITY = "nodal displacement and velocity, the worst of all steps, relative to the largest of the run"
REFERENCE = "FEniCSx (dolfinx) with the textbook form M a + f(u) = p, same P1 or P2 mesh"
TOLERANCE = 1e-8
NEEDS = ("dolfinx", "meshio", "h5py")

E, NU, RHO, H = 2e4, 0.35, 900.0, 0.01
GRAVITY = -9.81
MESHES = {(2, 1): ([24, 8], [1.2, 0.4]), (3, 1): ([9, 3, 3], [1.2, 0.4, 0.3]),  # by dimension and order
          (2, 2): ([9, 3], [1.2, 0.4]), (3, 2): ([4, 2, 1], [1.2, 0.4, 0.3])}
RULES = ["ImplicitEuler", "ImplicitNewmark", "BDF2"]


def moved(t):
    """Displacement of the held side: sideways, and up."""
    return 0.1 * np.sin(8 * t), 0.05 * t


def traction(t, x):
    """On the right side, per component: grows in time, linear along the side."""
    return 300 * t * (1 + 2 * x[1]), -400 * t


def spin(X):
    v = np.zeros_like(X)
    v[:, 0], v[:, 1] = -0.5 * X[:, 1], 0.5 * X[:, 0]
    return v


def scene_of(mesh, dim, order, rule, steps):
    zero = [0] * (dim - 2)
    return scene(
        mesh, {"type": "NeoHookean", "E": E, "nu": NU, "rho": RHO}, order,
        boundary_conditions={
            "rhs": [0, -GRAVITY] + zero,
            "dirichlet_boundary": [{"id": 1, "value": ["0.1 * sin(8 * t)", "0.05 * t"] + zero}],
            "neumann_boundary": [{"id": 3, "value": ["300 * t * (1 + 2 * y)", "-400 * t"] + zero}]},
        initial_conditions={"velocity": [{"id": 1, "value": ["-0.5 * y", "0.5 * x"] + zero}]},
        time={"dt": H, "time_steps": steps, "integrator": rule})


class Reference:
    def __init__(self, points, cells, order):
        self.dim = points.shape[1]
        length = points[:, 0].max()
        self.body = Body(points, cells, neo_hookean, lame(E, NU, self.dim), RHO,
                         {3: lambda x: np.isclose(x[0], length)}, order)
        self.points = self.body.nodes
        self.t = fem.Constant(self.body.domain, PETSc.ScalarType(0))
        zero = [0] * (self.dim - 2)
        gravity = ufl.as_vector([0, GRAVITY] + zero)
        push = ufl.as_vector([*traction(self.t, self.body.X), *zero])
        self.load = self.body.load(RHO * ufl.inner(gravity, self.body.test) * ufl.dx
                                   + ufl.inner(push, self.body.test) * self.body.ds(3))
        self.held = np.repeat(np.isclose(self.points[:, 0], 0), self.dim)

    def solve(self, n, inertia, predictor, guess):
        self.t.value = n * H
        targets = np.zeros_like(self.points)
        targets[:, 0], targets[:, 1] = moved(n * H)
        return self.body.solve(self.load(), self.held, targets.ravel(), guess, inertia, predictor)


def results(context):
    steps = 15 if context.quick else 50
    for (dim, order), (counts, size) in MESHES.items():
        points, cells = box_mesh(counts, size, jitter=0.25)
        mesh = context.folder / f"beam{dim}-p{order}.msh"
        write_mesh(mesh, points, cells)
        reference = Reference(points, cells, order)
        points = reference.points
        for rule in RULES:
            run = run_scene(context, f"{dim}d-p{order}-{rule}", scene_of(mesh, dim, order, rule, steps))
            states = integrate(reference.solve, rule, H, steps, np.zeros(points.size), spin(points).ravel())
            differences, sizes = [], []
            frames = list(run.frames())
            assert len(frames) == steps + 1 and np.array_equal(frames[0].rest, points)
            for frame, (u, v) in zip(frames[1:], states):
                differences.append([np.abs(frame.u.ravel() - u).max(), np.abs(frame.v.ravel() - v).max()])
                sizes.append([np.abs(u).max(), np.abs(v).max()])
            for k, name in enumerate(("displacement", "velocity")):
                errors = np.array(differences)[:, k] / np.array(sizes)[:, k].max()
                yield Result(f"{dim}D, P{order}, {rule}, {name}", float(errors.max()), TOLERANCE,
                             note=f"{steps} steps, {len(points)} nodes")
