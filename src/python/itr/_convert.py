# SPDX-License-Identifier: MIT
"""Meshes and results of other libraries: meshio, dolfinx."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ._itr import InputError

if TYPE_CHECKING:
    import dolfinx.fem
    import dolfinx.mesh
    import meshio

    from . import Simulation

Array = np.ndarray
TOPOLOGICAL_DIMENSION = {"vertex": 0, "line": 1, "line3": 1, "triangle": 2, "triangle6": 2, "quad": 2, "tetra": 3, "tetra10": 3}
QUADRATIC_EDGES = {2: [(0, 1), (1, 2), (2, 0)], 3: [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)]}
PHYSICAL = "gmsh:physical"


def from_meshio(mesh: meshio.Mesh) -> tuple[Array, Array, Array, dict[str, list[int]], dict[str, Array]]:
    """Vertices (n x d), cells (m x (d + 1), or with the nodes of their edges), bodies (m,), bodies by name and boundaries
    (k x d) by name of a meshio.Mesh. Points that no cell has are left out; cells are turned to positive volume."""
    kinds = {block.type for block in mesh.cells}
    dimension = 3 if kinds & {"tetra", "tetra10"} else 2
    if kinds & {"triangle6", "tetra10"}:
        kind, facet_kind = ("tetra10", "triangle6") if dimension == 3 else ("triangle6", "line3")
    else:
        kind, facet_kind = ("tetra", "triangle") if dimension == 3 else ("triangle", "line")
    others = {k for k in kinds - {kind} if TOPOLOGICAL_DIMENSION.get(k, dimension) >= dimension}
    if kind not in kinds or others:
        raise InputError(
            f"mesh: found cells {', '.join(sorted(others or kinds))}; expected tetra, triangle, tetra10 or triangle6 only: "
            "itr.simplices splits others"
        )
    cells, bodies = _blocks(mesh, kind)
    corners = np.unique(cells[:, : dimension + 1])
    used = np.concatenate([corners, np.setdiff1d(cells, corners)])  # boundaries count corners alone
    new = np.full(len(mesh.points), -1)
    new[used] = np.arange(len(used))
    vertices = np.asarray(mesh.points, float)[used]
    if dimension == 2 and vertices.shape[1] == 3 and np.ptp(vertices[:, 2]) > 0:
        raise InputError(f"mesh: found z from {vertices[:, 2].min()} to {vertices[:, 2].max()}; expected a plane of one z")
    cells = new[cells]
    edges = vertices[cells[:, 1 : dimension + 1], :dimension] - vertices[cells[:, :1], :dimension]
    inverted = np.linalg.det(edges) < 0
    cells[inverted] = cells[np.ix_(inverted, _turned(dimension, cells.shape[1]))]
    bodies, body_names = _named_bodies(mesh, kind, bodies, dimension)
    facets, tags = _blocks(mesh, facet_kind)
    facets = facets[:, :dimension]
    names = {int(tag): name for name, (tag, dim) in mesh.field_data.items() if dim == dimension - 1}
    boundaries = {names.get(tag, str(tag)): new[facets[tags == tag]] for tag in np.unique(tags).tolist() if tag != 0}
    outer = _outer_facets(cells[:, : dimension + 1])
    for name, members in _cell_sets(mesh, facet_kind).items():
        _add(boundaries, name, new[facets[members]], outer)
    for name, points in getattr(mesh, "point_sets", {}).items():
        is_in = np.zeros(len(vertices), bool)
        known = new[np.asarray(points, int).ravel()]
        is_in[known[known >= 0]] = True
        _add(boundaries, name, outer[is_in[outer].all(axis=1)], outer)
    return vertices[:, :dimension], cells, bodies, body_names, boundaries


def _add(boundaries: dict[str, Array], name: str, facets: Array, outer: Array) -> None:
    """Adds those of the facets that are on the boundary, if any: sets of cells have none."""
    known = set(map(tuple, np.sort(outer, axis=1).tolist()))
    facets = [facet for facet in np.sort(facets, axis=1).tolist() if tuple(facet) in known]
    if facets:
        boundaries[name] = np.array(facets + boundaries.get(name, np.empty((0, len(facets[0])), int)).tolist())


def _outer_facets(cells: Array) -> Array:
    corners = range(cells.shape[1])
    facets = np.concatenate([np.delete(cells, corner, axis=1) for corner in corners])
    ascending, count = np.unique(np.sort(facets, axis=1), axis=0, return_counts=True)
    return ascending[count == 1]


def _cell_sets(mesh: meshio.Mesh, kind: str) -> dict[str, Array]:
    """Of the cells of a kind, as _blocks lists them: which each set has."""
    sets = {}
    for name, blocks in getattr(mesh, "cell_sets", {}).items():
        members, first = [], 0
        for block, chosen in zip(mesh.cells, blocks):
            if block.type != kind:
                continue
            if chosen is not None:
                members += [first + int(i) for i in np.asarray(chosen, int).ravel()]
            first += len(block.data)
        if members and not name.startswith("gmsh:"):
            sets[name] = np.array(members, int)
    return sets


def _named_bodies(mesh: meshio.Mesh, kind: str, bodies: Array, dimension: int) -> tuple[Array, dict[str, list[int]]]:
    """Bodies such that each set of cells is some of them, and which: parts of a body that are in other sets get new ids."""
    names = {name: [int(tag)] for name, (tag, dim) in mesh.field_data.items() if dim == dimension}
    sets = _cell_sets(mesh, kind)
    signature = np.column_stack([bodies] + [np.isin(np.arange(len(bodies)), members) for members in sets.values()])
    parts, of_cell = np.unique(signature, axis=0, return_inverse=True)
    ids, used = [], set()
    for number, *_ in parts.tolist():
        ids.append(number if number not in used else max(used | set(bodies.tolist())) + 1)
        used.add(ids[-1])
    for i, name in enumerate(sets):
        names[name] = [body for body, part in zip(ids, parts.tolist()) if part[i + 1]]
    for tags in names.values():  # all parts of the bodies that Gmsh numbers
        tags += [body for body, part in zip(ids, parts.tolist()) if part[0] in tags and body not in tags]
    return np.array(ids)[of_cell.ravel()], names


def _turned(dimension: int, nodes: int) -> list[int]:
    """The order of a cell's nodes with its last two corners exchanged."""
    corners = [*range(dimension - 1), dimension, dimension - 1]
    if nodes == dimension + 1:
        return corners
    edges = [frozenset(edge) for edge in QUADRATIC_EDGES[dimension]]
    return corners + [dimension + 1 + edges.index(frozenset((corners[i], corners[j]))) for i, j in QUADRATIC_EDGES[dimension]]


def _quadratic_cells(simulation: Simulation) -> tuple[Array, Array]:
    """Cells with a node at each edge in meshio's order, and the straight edges, whose nodes come after the simulation's."""
    cells, d = simulation.cells, simulation.dimension
    edges = np.sort(np.concatenate([cells[:, list(edge)] for edge in QUADRATIC_EDGES[d]]), axis=1)
    unique, of_cell = np.unique(edges, axis=0, return_inverse=True)
    curved = {tuple(edge): simulation.num_vertices + i for i, edge in enumerate(simulation.curved_edges.tolist())}
    straight = np.array([edge for edge in unique.tolist() if tuple(edge) not in curved], int).reshape(-1, 2)
    first = simulation.num_vertices + len(curved)
    nodes = curved | {tuple(edge): first + i for i, edge in enumerate(straight.tolist())}
    middle = np.array([nodes[tuple(edge)] for edge in unique.tolist()])[of_cell.ravel()]
    return np.column_stack([cells, middle.reshape(-1, len(cells)).T]), straight


def _with_means(field: Array, edges: Array) -> Array:
    """A field by node, with the means of the ends of some edges behind it."""
    return np.concatenate([field, (field[edges[:, 0]] + field[edges[:, 1]]) / 2])


def _blocks(mesh: meshio.Mesh, kind: str) -> tuple[Array, Array]:
    """All cells of a kind, and their physical groups, 0 where there are none."""
    places = [i for i, block in enumerate(mesh.cells) if block.type == kind]
    if not places:
        return np.empty((0, 6), int), np.empty(0, int)
    groups = mesh.cell_data.get(PHYSICAL)
    tags = [np.zeros(len(mesh.cells[i].data), int) if groups is None else np.asarray(groups[i], int) for i in places]
    return np.concatenate([np.asarray(mesh.cells[i].data, int) for i in places]), np.concatenate(tags)


def to_meshio(simulation: Simulation) -> meshio.Mesh:
    import meshio

    kind, cells, straight = "tetra" if simulation.dimension == 3 else "triangle", simulation.cells, np.empty((0, 2), int)
    if len(simulation.curved_edges):
        kind = "tetra10" if simulation.dimension == 3 else "triangle6"
        cells, straight = _quadratic_cells(simulation)

    def in_space(field: Array) -> Array:
        return np.pad(_with_means(field, straight), [(0, 0), (0, 3 - simulation.dimension)])

    x = in_space(simulation.positions)
    return meshio.Mesh(
        x,
        [(kind, cells)],
        point_data={"displacement": x - in_space(simulation.rest_positions), "velocity": in_space(simulation.velocities)},
        cell_data={"body": [simulation.bodies], "elastic_density": [simulation.elastic_density]},
    )


def to_dolfinx(
    simulation: Simulation, comm: Any = None
) -> tuple[dolfinx.mesh.Mesh, dict[str, dolfinx.fem.Function]]:
    import dolfinx.fem
    import dolfinx.mesh
    import ufl
    from mpi4py import MPI

    comm = MPI.COMM_SELF if comm is None else comm
    if comm.size != 1:
        raise InputError(f"comm: found {comm.size} ranks; expected 1, of which a simulation is")
    d = simulation.dimension
    cell = ufl.Cell("triangle" if d == 2 else "tetrahedron", geometric_dimension=d)
    domain = ufl.Mesh(ufl.VectorElement("Lagrange", cell, 1))
    nodes = simulation.num_vertices
    mesh = dolfinx.mesh.create_mesh(comm, simulation.cells.astype(np.int64), simulation.rest_positions[:nodes], domain)
    ours = np.asarray(mesh.topology.original_cell_index)
    constant = dolfinx.fem.FunctionSpace(mesh, ("DG", 0))
    fields = {"displacement": simulation.positions - simulation.rest_positions, "velocity": simulation.velocities}
    functions = {}
    if len(simulation.curved_edges):
        from scipy.spatial import cKDTree

        straight = _quadratic_cells(simulation)[1]
        space = dolfinx.fem.VectorFunctionSpace(mesh, ("Lagrange", 2))
        tree = cKDTree(_with_means(simulation.rest_positions, straight))
        place = tree.query(space.tabulate_dof_coordinates()[:, :d])[1]
        for name, values in fields.items():
            functions[name] = dolfinx.fem.Function(space, name=name)
            functions[name].x.array.reshape(-1, d)[:] = _with_means(values, straight)[place]
    else:
        vertex = np.asarray(mesh.geometry.input_global_indices)  # of ours, by node of theirs
        linear = dolfinx.fem.VectorFunctionSpace(mesh, ("Lagrange", 1))
        # Dofs of a linear space are numbered cell by cell as the nodes of the geometry, but not always with their numbers.
        of_cells, dofs = mesh.geometry.dofmap.array, linear.dofmap.list.array
        for name, values in fields.items():
            functions[name] = dolfinx.fem.Function(linear, name=name)
            functions[name].x.array.reshape(-1, d)[dofs] = values[vertex[of_cells]]
    functions["elastic_density"] = dolfinx.fem.Function(constant, name="elastic_density")
    functions["elastic_density"].x.array[constant.dofmap.list.array] = simulation.elastic_density[ours]
    return mesh, functions
