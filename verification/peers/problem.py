# SPDX-License-Identifier: MIT
"""One description of a problem with contact, from which the scene of ITR, the deck of CalculiX and the program for GetFEM are
written, so that all of them have the same mesh, supports, loads and laws."""
import dataclasses
import pathlib
import sys

import numpy as np

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path[:0] = [str(ROOT / "verification"), str(ROOT / "examples"), str(ROOT / "examples/assemblies")]
from harness.scenes import with_edge_nodes  # noqa: E402


@dataclasses.dataclass
class Body:
    points: np.ndarray  # n x d
    cells: np.ndarray  # m x (d + 1), positive
    material: dict  # type (IsochoricNeoHooke, SaintVenant, LinearElasticity), E, nu


@dataclasses.dataclass
class Held:
    """Facets with their barycentre in a box, held at `values`: axis -> displacement at t = 1, or a curve [(t, displacement)]."""
    body: int
    box: list
    values: dict


@dataclasses.dataclass
class Load:
    """A traction on facets at t = 1, by their area at rest."""
    body: int
    box: list
    traction: list


@dataclasses.dataclass
class Contact:
    """Facets of a body (`slave`, its box) that touch those of another body, or the rigid plane x_last = 0 below."""
    slave: int
    box: list
    master: int | None = None
    master_box: list | None = None


@dataclasses.dataclass
class Problem:
    section: str  # plane strain, axisymmetric or solid
    bodies: list
    held: list
    contacts: list
    reactions: dict  # name of a curve -> (index of `held`, axis)
    points: dict  # name of a curve -> (body, place at rest, axis)
    measure: object  # function of curves (name -> array, "t" among them): the value
    loads: list = dataclasses.field(default_factory=list)
    friction: float = 0.0
    tend: float = 1.0
    length: float = 1.0  # of a rigid plane

    @property
    def dim(self):
        return self.bodies[0].points.shape[1]

    def unknowns(self, order):
        counts = [len(b.points) if order == 1 else len(with_edge_nodes(b.points, b.cells)[0]) for b in self.bodies]
        return self.dim * sum(counts)


def value_at(value, t):
    """Of Held.values, at a time."""
    return float(np.interp(t, *zip(*value))) if isinstance(value, list) else value * t


# Corners of a cell's facets, in the order of CalculiX.
FACETS = {2: [(0, 1), (1, 2), (2, 0)], 3: [(0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)]}


def boundary(body):
    """Of the facets of one cell only: (cell, number of the facet) and corners."""
    dim = body.points.shape[1]
    corners = np.stack([body.cells[:, list(f)] for f in FACETS[dim]], axis=1)  # cell, facet, corner
    flat = np.sort(corners.reshape(-1, dim), axis=1)
    _, first, count = np.unique(flat, axis=0, return_index=True, return_counts=True)
    chosen = np.sort(first[count == 1])
    return np.stack([chosen // (dim + 1), chosen % (dim + 1)], axis=1), corners.reshape(-1, dim)[chosen]


def facets_in(body, box):
    """Facets of the boundary whose barycentres are in a box, as boundary() gives them."""
    where, corners = boundary(body)
    middle = body.points[corners].mean(axis=1)
    inside = ((middle >= np.array(box[0])) & (middle <= np.array(box[1]))).all(axis=1)
    return where[inside], corners[inside]


def nodes_and_cells(body, order):
    """Nodes (n x d) and cells of linear or quadratic elements; new nodes are in the middle of straight edges."""
    return (body.points, body.cells) if order == 1 else with_edge_nodes(body.points, body.cells)[:2]


def nodes_of(body, order, box):
    """Of the facets in a box."""
    _, cells = nodes_and_cells(body, order)
    dim = body.points.shape[1]
    local = [list(f) for f in FACETS[dim]]
    if order == 2:
        pairs = {2: [(0, 1), (1, 2), (0, 2)], 3: [(0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3)]}[dim]
        local = [f + [dim + 1 + k for k, pair in enumerate(pairs) if set(pair) <= set(f)] for f in local]
    where, _ = facets_in(body, box)
    return np.unique([n for cell, facet in where for n in cells[cell][local[facet]]])
