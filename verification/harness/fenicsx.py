# SPDX-License-Identifier: MIT
"""The reference: finite elements by FEniCSx on the mesh and in the vertex numbering of ours."""
import logging

import numpy as np
import scipy.sparse
import scipy.sparse.linalg
import ufl
from dolfinx import fem, mesh
from dolfinx.fem import petsc
from mpi4py import MPI
from petsc4py import PETSc
from scipy.spatial import cKDTree

from harness.scenes import with_edge_nodes

logging.disable(logging.INFO)  # the form compiler tells of every file that it compiles


def create_domain(points, cells):
    """The mesh in dolfinx, and for each of its local vertices the index in `points`."""
    dim = points.shape[1]
    element = ufl.VectorElement("Lagrange", {2: "triangle", 3: "tetrahedron"}[dim], 1)
    domain = mesh.create_mesh(MPI.COMM_SELF, np.asarray(cells, dtype=np.int64), np.ascontiguousarray(points, dtype=float),
                              ufl.Mesh(element))
    return domain, np.array(domain.geometry.input_global_indices)


def to_csr(matrix):
    indptr, indices, values = matrix.getValuesCSR()
    return scipy.sparse.csr_matrix((values, indices, indptr), shape=matrix.getSize())


def nodes_of_dofs(V, nodes):
    """For each dof (block) of a Lagrange space the index of its place in `nodes`."""
    distance, node = cKDTree(nodes).query(V.tabulate_dof_coordinates()[:, :nodes.shape[1]])
    assert len(node) == len(nodes) and distance.max() < 1e-9 * np.ptp(nodes)
    return node


def scalar_mass(points, cells, density):
    """P1 mass matrix with one density a cell, in the numbering of `points`."""
    domain, original = create_domain(points, cells)
    V = fem.FunctionSpace(domain, ("Lagrange", 1))
    rho = fem.Function(fem.FunctionSpace(domain, ("DG", 0)))
    rho.x.array[:] = np.asarray(density)[domain.topology.original_cell_index]
    u, v = ufl.TrialFunction(V), ufl.TestFunction(V)
    assembled = petsc.assemble_matrix(fem.form(rho * u * v * ufl.dx))
    assembled.assemble()
    vertex = vertices_of_dofs(domain, original, V)
    coo = to_csr(assembled).tocoo()
    assembled.destroy()
    return scipy.sparse.csr_matrix((coo.data, (vertex[coo.row], vertex[coo.col])), shape=coo.shape)


def vertices_of_dofs(domain, original, V):
    """For each P1 dof (block) the index of its vertex in our order: both maps list a cell's vertices in one order."""
    cells = domain.topology.index_map(domain.topology.dim).size_local
    dofs = V.dofmap.list.array.reshape(cells, -1)
    nodes = domain.geometry.dofmap.array.reshape(cells, -1)
    vertex = np.empty(len(original), dtype=int)
    vertex[dofs] = original[nodes]
    return vertex


def straightened(num_points, edges, curved, dim):
    """The matrix from values at the points and at the nodes of `curved` edges to those at the nodes of all `edges`: the node of
    another edge has the mean of its ends. Edges have ascending ends; values are flat."""
    number = {tuple(edge): num_points + k for k, edge in enumerate(curved)}
    entries = [(i, i, 1.0) for i in range(num_points)]
    for k, edge in enumerate(map(tuple, edges)):
        entries += [(num_points + k, number[edge], 1.0)] if edge in number else [(num_points + k, end, 0.5) for end in edge]
    row, column, value = zip(*entries)
    shape = (num_points + len(edges), num_points + len(curved))
    return scipy.sparse.kron(scipy.sparse.csr_matrix((value, (row, column)), shape), scipy.sparse.identity(dim), "csr")


class Space:
    """P1 or P2 vectors on a mesh. Arrays are n x dim in the order of `nodes`, which begin with `points`; matrices act on them
    flattened. With `curved` edges (ascending pairs) the other edges of P2 are straight, and their nodes no unknowns."""

    def __init__(self, points, cells, order=1, curved=None):
        self.dim = points.shape[1]
        self.order = order
        self.nodes, self.prolongation = points, None
        if order == 2:
            self.nodes, _, edges = with_edge_nodes(points, cells)
        all_nodes = self.nodes
        if curved is not None:
            self.prolongation = straightened(len(points), edges, curved, self.dim)
            self.nodes = np.concatenate([points, points[curved].mean(axis=1)])
        self.num_nodes = len(self.nodes)
        self.domain, self.original = create_domain(points, cells)
        self.V = fem.VectorFunctionSpace(self.domain, ("Lagrange", order))
        if order == 1:
            node_of_dof = vertices_of_dofs(self.domain, self.original, self.V)
        else:
            node_of_dof = nodes_of_dofs(self.V, all_nodes)
        block = np.arange(self.dim)
        self.rows = (self.dim * node_of_dof[:, None] + block).ravel()  # our flat index of each dolfinx dof

    def coefficient(self, values):
        """A number, or one value a cell in our order, as something that forms take."""
        if np.ndim(values) == 0:
            return fem.Constant(self.domain, PETSc.ScalarType(values))
        function = fem.Function(fem.FunctionSpace(self.domain, ("DG", 0)))
        function.x.array[:] = np.asarray(values)[self.domain.topology.original_cell_index]
        return function

    def matrix(self, form):
        assembled = petsc.assemble_matrix(fem.form(form))
        assembled.assemble()
        return self.renumbered(assembled)

    def renumbered(self, assembled):
        coo = to_csr(assembled).tocoo()
        assembled.destroy()
        matrix = scipy.sparse.csr_matrix((coo.data, (self.rows[coo.row], self.rows[coo.col])), shape=coo.shape)
        return matrix if self.prolongation is None else self.prolongation.T @ matrix @ self.prolongation

    def to_ours(self, values):
        flat = np.empty(len(values))
        flat[self.rows] = values
        return flat if self.prolongation is None else self.prolongation.T @ flat

    def mass(self, density=1.0):
        u, v = ufl.TrialFunction(self.V), ufl.TestFunction(self.V)
        return self.matrix(self.coefficient(density) * ufl.inner(u, v) * ufl.dx)


class Body(Space):
    """A hyperelastic body: internal forces and their tangent, consistent forces of loads.

    `law(F, *parameters, dim, ufl)` is the strain energy density; `parameters` and `rho` are numbers, or arrays of one
    value a cell; `sides` names facets by predicates of coordinates.
    """

    def __init__(self, points, cells, law, parameters, rho=1.0, sides=None, order=1, curved=None):
        super().__init__(points, cells, order, curved)
        self.rho = rho
        constants = [self.coefficient(p) for p in parameters]
        self.u = fem.Function(self.V)
        F = ufl.Identity(self.dim) + ufl.grad(self.u)
        # Constant in a linear cell; in a quadratic one by the library's default, so that both solve the same problem.
        energy = law(F, *constants, self.dim, ufl) * ufl.dx(metadata={"quadrature_degree": order})
        test = ufl.TestFunction(self.V)
        gradient = ufl.derivative(energy, self.u, test)
        self.energy_form = fem.form(energy)
        self.force_form = fem.form(gradient)
        self.tangent_form = fem.form(ufl.derivative(gradient, self.u))
        self.test = test
        self.X = ufl.SpatialCoordinate(self.domain)
        facets, tags = [], []
        for tag, predicate in (sides or {}).items():
            found = mesh.locate_entities_boundary(self.domain, self.dim - 1, predicate)
            facets.append(found)
            tags.append(np.full(len(found), tag, dtype=np.int32))
        if facets:
            facets, tags = np.concatenate(facets), np.concatenate(tags)
            order = np.argsort(facets)
            marked = mesh.meshtags(self.domain, self.dim - 1, facets[order], tags[order])
            self.ds = ufl.Measure("ds", domain=self.domain, subdomain_data=marked)
        self.mass_matrix = self.mass(rho)

    def set_displacement(self, u):
        flat = np.asarray(u).ravel()
        self.u.x.array[:] = (flat if self.prolongation is None else self.prolongation @ flat)[self.rows]

    def energy(self, u):
        self.set_displacement(u)
        return fem.assemble_scalar(self.energy_form)

    def internal_force(self, u):
        self.set_displacement(u)
        return self.to_ours(fem.assemble_vector(self.force_form).array)

    def tangent(self, u):
        self.set_displacement(u)
        assembled = petsc.assemble_matrix(self.tangent_form)
        assembled.assemble()
        return self.renumbered(assembled)

    def load(self, form):
        """A compiled linear form: call `load()()` again when its constants change."""
        compiled = fem.form(form)
        return lambda: self.to_ours(fem.assemble_vector(compiled).array)

    def solve(self, forces, held, targets, u, inertia=0.0, predictor=None):
        """u with inertia * M (u - predictor) + internal forces = forces, where held dofs (flags) have their targets.
        Newton from `u` until steps are round-off."""
        u = np.array(u, dtype=float).ravel()
        u[held] = targets[held]
        free = np.flatnonzero(~held)
        smallest = np.inf
        for _ in range(60):
            residual = self.internal_force(u) - forces
            tangent = self.tangent(u)
            if inertia:
                residual += inertia * (self.mass_matrix @ (u - predictor))
                tangent = tangent + inertia * self.mass_matrix
            step = scipy.sparse.linalg.spsolve(tangent[free][:, free].tocsc(), -residual[free])
            size = np.abs(step).max()
            u[free] += step
            scale = max(np.abs(u).max(), 1e-300)
            if size < 1e-15 * scale or (size < 1e-11 * scale and size >= smallest):
                return u
            smallest = min(smallest, size)
        raise RuntimeError(f"the reference's Newton did not converge: last step {size:.3g}")
