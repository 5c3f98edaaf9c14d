# SPDX-License-Identifier: MIT
"""Heat in the bodies of a plane simulation, by dolfinx on ITR's mesh: linear elements, conduction in the deformed shape, and contact
conductance, a flux h(p) (T_a - T_b) through surfaces that ITR presses on each other with the pressure p."""

import numpy as np
import scipy.sparse
import scipy.sparse.linalg
import ufl
from dolfinx import fem
from dolfinx.fem import petsc


class Heat:
    """`temperature` (n,) is by vertex of the present mesh, and follows it by the L2 projection, which keeps the heat content.

    `conductivity` [W/m/K] by body, `capacity` by rest volume [J/m^3/K], `conductance` h(p) [W/m^2/K], `held`: temperatures by
    boundary id, `initial`: of all bodies. `transfers` has the heat content before and after each change of the mesh."""

    def __init__(self, simulation, conductivity, capacity, conductance, held, initial):
        self.simulation, self.conductivity, self.capacity, self.conductance = simulation, conductivity, capacity, conductance
        self.held, self.temperature = held, np.full(simulation.num_vertices, float(initial))
        self.transfers = []
        simulation.watch_forces()
        simulation.on_mesh_change(self._carry)
        self._discretise()

    def _carry(self, change):
        before = self.content
        self.temperature = change.project(self.temperature)
        self._discretise()
        self.transfers.append((before, self.content))

    def _discretise(self):
        """Mass and conduction in the present shape, by our vertices."""
        mesh, fields = self.simulation.to_dolfinx()
        space, constant = fem.FunctionSpace(mesh, ("Lagrange", 1)), fem.FunctionSpace(mesh, ("DG", 0))
        vertices = np.asarray(mesh.geometry.input_global_indices)[mesh.geometry.dofmap.array]
        dof = np.empty(len(self.temperature), int)
        dof[vertices] = space.dofmap.list.array

        def matrix(form):
            assembled = petsc.assemble_matrix(fem.form(form))
            assembled.assemble()
            rows, columns, values = assembled.getValuesCSR()
            size = assembled.getSize()
            assembled.destroy()
            return scipy.sparse.csr_matrix((values, columns, rows), size)[dof][:, dof]

        k = fem.Function(constant)
        bodies = self.simulation.bodies[np.asarray(mesh.topology.original_cell_index)]
        k.x.array[constant.dofmap.list.array] = [self.conductivity[body] for body in bodies]
        T, v = ufl.TrialFunction(space), ufl.TestFunction(space)
        F = ufl.Identity(mesh.topology.dim) + ufl.grad(fields["displacement"])
        pull = k * ufl.det(F) * ufl.inv(F) * ufl.inv(F).T  # conductivity of the deformed shape, seen from rest
        self._conduction = matrix(ufl.inner(pull * ufl.grad(T), ufl.grad(v)) * ufl.dx)
        self._mass = matrix(fem.Constant(mesh, float(self.capacity)) * T * v * ufl.dx)

    @property
    def content(self):
        """[J], in 2D [J/m]"""
        return self._mass.dot(self.temperature).sum()

    def bodies(self):
        """Of each vertex."""
        body = np.empty(len(self.simulation.positions), int)
        body[self.simulation.cells] = self.simulation.bodies[:, None]
        return body

    def contact(self):
        """Matrix of the flux through surfaces in contact: each pressed vertex conducts through half of its area to the nearest
        point of another body, so that both sides have their half."""
        s = self.simulation
        pressure, force, x = s.contact_pressure, np.linalg.norm(s.forces("contact"), axis=1), s.positions
        body = self.bodies()
        rows, weights = [], []
        for v in np.flatnonzero(pressure > 0):
            a, b = s.facets[body[s.facets[:, 0]] != body[v]].T
            along = x[b] - x[a]
            t = np.clip(((x[v] - x[a]) * along).sum(1) / (along**2).sum(1), 0, 1)
            nearest = np.argmin(np.linalg.norm(x[a] + t[:, None] * along - x[v], axis=1))
            rows.append(([v, a[nearest], b[nearest]], [1, t[nearest] - 1, -t[nearest]]))
            weights.append(self.conductance(pressure[v]) * force[v] / pressure[v] / 2)
        columns = np.array([row[0] for row in rows]).reshape(-1)
        jump = scipy.sparse.csr_matrix(
            (np.array([row[1] for row in rows]).reshape(-1), columns, np.arange(0, 3 * len(rows) + 1, 3)), (len(rows), len(x)))
        return jump.T @ scipy.sparse.diags(weights) @ jump if rows else scipy.sparse.csr_matrix((len(x), len(x)))

    def step(self, dt=None):
        """Takes a step of implicit Euler, or without dt finds the steady state. Returns the heat flux out of each held boundary
        into the bodies [W], in 2D [W/m]."""
        s = self.simulation
        self._discretise()
        matrix = self._conduction + self.contact()
        if dt:
            matrix = matrix + self._mass / dt
        load = self._mass.dot(self.temperature) / dt if dt else np.zeros(len(self.temperature))
        on = {id: np.unique(s.facets[s.facet_boundaries == id]) for id in self.held}
        free = np.ones(len(load), bool)
        for id, vertices in on.items():
            self.temperature[vertices], free[vertices] = self.held[id], False
        right = load[free] - matrix[free][:, ~free] @ self.temperature[~free]
        self.temperature[free] = scipy.sparse.linalg.spsolve(matrix[free][:, free].tocsc(), right)
        flux = matrix @ self.temperature - load
        return {id: flux[vertices].sum() for id, vertices in on.items()}
