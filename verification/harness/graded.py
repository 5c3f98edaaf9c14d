# SPDX-License-Identifier: MIT
"""Clamped bodies, Cook's membrane among them, by FEniCSx with elements of any degree on meshes graded towards what is singular."""
import time

import numpy as np
import ufl
from dolfinx import fem, geometry, mesh
from dolfinx.fem import petsc
from harness.fenicsx import create_domain
from harness.materials import lame, neo_hookean
from harness.scenes import box_mesh, oriented
from mpi4py import MPI
from petsc4py import PETSc

CORNERS = np.array([(0.0, 0.0), (48.0, 44.0), (0.0, 44.0), (48.0, 60.0)])  # of (s, t) = (0, 0), (1, 0), (0, 1), (1, 1)


def mapped_mesh(n, grading):
    """n x n x 2 triangles; `grading` is the exponent by which they shrink towards the clamped side and its ends."""
    st, cells = box_mesh([n, n], [1.0, 1.0])
    s, t = st.T
    s = s**grading
    t = np.where(t < 0.5, (2 * t)**grading, 2 - (2 - 2 * t)**grading) / 2
    weights = np.stack([(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t], axis=1)
    points = weights @ CORNERS
    return points, oriented(points, cells)


def graded_bar(counts, size, grading):
    """A box of tetrahedra that shrink towards the side x = 0 and its edges."""
    points, cells = box_mesh(counts, [1.0] * len(counts))
    towards_both = np.where(points < 0.5, (2 * points)**grading, 2 - (2 - 2 * points)**grading) / 2
    points = np.column_stack([points[:, 0]**grading, towards_both[:, 1:]]) * size
    return points, oriented(points, cells)


class Clamped:
    """The static solution of a body held where x = 0 and pulled where x is largest: unknowns, energy [J], displacement of the tip (the
    point of largest sum of coordinates) [m], seconds of the solve, and its gradient anywhere."""

    def __init__(self, points, cells, degree, E, nu, traction, density=neo_hookean, steps=5):
        dim, end = points.shape[1], points[:, 0].max()
        self.domain, _ = create_domain(points, cells)
        V = fem.VectorFunctionSpace(self.domain, ("Lagrange", degree))
        self.u = fem.Function(V)
        v = ufl.TestFunction(V)
        right = mesh.locate_entities_boundary(self.domain, dim - 1, lambda x: np.isclose(x[0], end))
        ds = ufl.Measure("ds", domain=self.domain,
                         subdomain_data=mesh.meshtags(self.domain, dim - 1, np.sort(right), np.ones(len(right), dtype=np.int32)))
        share = fem.Constant(self.domain, PETSc.ScalarType(0))
        F = ufl.Identity(dim) + ufl.grad(self.u)
        dx = ufl.dx(metadata={"quadrature_degree": max(1, 4 * (degree - 1))})
        pull = ufl.as_vector(traction)
        energy = density(F, *lame(E, nu, dim), dim, ufl) * dx - share * ufl.inner(pull, self.u) * ds(1)
        residual = ufl.derivative(energy, self.u, v)
        tangent = fem.form(ufl.derivative(residual, self.u))
        residual, energy = fem.form(residual), fem.form(energy)
        left = fem.locate_dofs_topological(V, dim - 1, mesh.locate_entities_boundary(self.domain, dim - 1, lambda x: np.isclose(x[0], 0)))
        held = fem.dirichletbc(np.zeros(dim), left, V)
        self.unknowns = V.dofmap.index_map.size_global * dim - dim * len(left)
        solver = PETSc.KSP().create(MPI.COMM_SELF)
        solver.setType("preonly")
        solver.getPC().setType("lu")
        solver.getPC().setFactorSolverType("mumps")
        start = time.perf_counter()
        for k in range(1, steps + 1):
            share.value = k / steps
            for _ in range(30):
                A = petsc.assemble_matrix(tangent, [held])
                A.assemble()
                b = petsc.assemble_vector(residual)
                petsc.set_bc(b, [held])
                solver.setOperators(A)
                step = b.duplicate()
                solver.solve(b, step)
                before, size = self.u.x.array.copy(), np.abs(step.array).max()
                for halving in range(20):  # at the corners a full step may invert
                    self.u.x.array[:] = before - step.array / 2**halving
                    if np.isfinite(fem.assemble_scalar(energy)):
                        break
                for thing in (A, b, step):
                    thing.destroy()
                if size < 1e-9:
                    break
            else:
                raise RuntimeError(f"no convergence of the reference's Newton: last step {size:.3g}")
        self.seconds = time.perf_counter() - start
        self.energy = fem.assemble_scalar(energy)
        self.tip = self.values_at(self.u, points[[points.sum(axis=1).argmax()]])[0]
        slope = fem.TensorFunctionSpace(self.domain, ("DG", degree - 1))
        self.slope = fem.Function(slope)
        self.slope.interpolate(fem.Expression(ufl.grad(self.u), slope.element.interpolation_points()))

    def values_at(self, function, places):
        """Values of a function at places (a row each) of the body."""
        dim = places.shape[1]
        flat = np.zeros((len(places), 3))
        flat[:, :dim] = places
        tree = geometry.BoundingBoxTree(self.domain, dim, padding=1e-9)
        cells = geometry.compute_colliding_cells(self.domain, geometry.compute_collisions(tree, flat), flat)
        return function.eval(flat, [cells.links(i)[0] for i in range(len(flat))]).reshape(len(flat), -1)

    def gradient_at(self, places):
        """du_i/dX_j, n x dim x dim."""
        return self.values_at(self.slope, places).reshape(len(places), places.shape[1], -1)
