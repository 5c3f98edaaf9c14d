# SPDX-License-Identifier: MIT
"""A box of two materials grown together, one soft and one stiff: as a mesh file and as FEniCSx sees it, for every law."""
import dataclasses
import pathlib

import numpy as np
import ufl

from harness.fenicsx import Body
from harness.materials import Law, laws
from harness.scenes import box_mesh, with_edge_nodes, write_mesh

PULLED = 3  # tag of the side at the end of the x axis
MIXED = "mixed"  # order of elements: the first body linear, the second quadratic


@dataclasses.dataclass
class TwoBodies:
    dim: int
    mesh: pathlib.Path
    points: np.ndarray
    cells: np.ndarray
    name: str  # of the law
    law: Law
    rho: np.ndarray  # of each cell
    body: Body
    order: object

    def load(self, acceleration, traction):
        """Nodal forces of UFL expressions: of the mass, and on the side PULLED."""
        density, test = self.body.coefficient(self.rho), self.body.test
        return self.body.load(density * ufl.inner(acceleration, test) * ufl.dx
                              + ufl.inner(traction, test) * self.body.ds(PULLED))()

    def materials(self):
        """As a scene has them."""
        return [{"id": k + 1, **material} for k, material in enumerate(self.law.scene)]

    def discr_order(self):
        """As a scene has it."""
        return [{"id": 1, "order": 1}, {"id": 2, "order": 2}] if self.order == MIXED else self.order


def curved_edges(points, cells, quadratic):
    """Edges whose cells are all quadratic, ascending: those of any other cell are straight."""
    edges_of = lambda chosen: {tuple(edge) for edge in with_edge_nodes(points, cells[chosen])[2]}
    return np.array(sorted(edges_of(quadratic) - edges_of(~quadratic)))


def two_bodies(folder, boxes, order=1, of=laws):
    """One after the other; `boxes` has counts of cells and size by dimension, `order` is that of the elements or MIXED, `of`
    gives laws by dimension."""
    for dim, (counts, size) in boxes.items():
        points, cells = box_mesh(counts, size, jitter=0.25, seed=dim)
        bodies = np.where(points[cells].mean(axis=1)[:, 0] < size[0] / 2, 1, 2)
        mesh = folder / f"box{dim}.msh"
        write_mesh(mesh, points, cells, bodies)
        by_cell = lambda values: np.asarray(values)[bodies - 1]
        curved = curved_edges(points, cells, bodies == 2) if order == MIXED else None
        for name, law in of(dim).items():
            parameters = zip(*(law.parameters(material, dim) for material in law.scene))
            rho = by_cell([material["rho"] for material in law.scene])
            body = Body(points, cells, law.density, [by_cell(p) for p in parameters], rho,
                        {PULLED: lambda x: np.isclose(x[0], size[0])},
                        2 if order == MIXED else order, curved)
            yield TwoBodies(dim, mesh, points, cells, name, law, rho, body, order)
