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
TOPOLOGICAL_DIMENSION = {"vertex": 0, "line": 1, "triangle": 2, "quad": 2, "tetra": 3}
PHYSICAL = "gmsh:physical"


def from_meshio(mesh: meshio.Mesh) -> tuple[Array, Array, Array, dict[str, Array]]:
    """Vertices (n x d), cells (m x (d + 1)), bodies (m,) and boundaries (k x d) by name of a meshio.Mesh. Points that no cell
    has are left out; cells are turned to positive volume."""
    kinds = {block.type for block in mesh.cells}
    dimension = 3 if "tetra" in kinds else 2
    kind, facet_kind = ("tetra", "triangle") if dimension == 3 else ("triangle", "line")
    others = {k for k in kinds - {kind} if TOPOLOGICAL_DIMENSION.get(k, dimension) >= dimension}
    if kind not in kinds or others:
        raise InputError(f"mesh: found cells {', '.join(sorted(others or kinds))}; expected tetra or triangle only")
    cells, bodies = _blocks(mesh, kind)
    used = np.unique(cells)
    new = np.full(len(mesh.points), -1)
    new[used] = np.arange(len(used))
    vertices = np.asarray(mesh.points, float)[used]
    if dimension == 2 and vertices.shape[1] == 3 and np.ptp(vertices[:, 2]) > 0:
        raise InputError(f"mesh: found z from {vertices[:, 2].min()} to {vertices[:, 2].max()}; expected a plane of one z")
    cells = new[cells]
    edges = vertices[cells[:, 1:], :dimension] - vertices[cells[:, :1], :dimension]
    inverted = np.linalg.det(edges) < 0
    cells[inverted, -2:] = cells[inverted, :-3:-1]
    facets, tags = _blocks(mesh, facet_kind)
    names = {int(tag): name for name, (tag, dim) in mesh.field_data.items() if dim == dimension - 1}
    boundaries = {names.get(tag, str(tag)): new[facets[tags == tag]] for tag in np.unique(tags).tolist() if tag != 0}
    return vertices[:, :dimension], cells, bodies, boundaries


def _blocks(mesh: meshio.Mesh, kind: str) -> tuple[Array, Array]:
    """All cells of a kind, and their physical groups, 0 where there are none."""
    places = [i for i, block in enumerate(mesh.cells) if block.type == kind]
    if not places:
        return np.empty((0, TOPOLOGICAL_DIMENSION[kind] + 1), int), np.empty(0, int)
    groups = mesh.cell_data.get(PHYSICAL)
    tags = [np.zeros(len(mesh.cells[i].data), int) if groups is None else np.asarray(groups[i], int) for i in places]
    return np.concatenate([np.asarray(mesh.cells[i].data, int) for i in places]), np.concatenate(tags)


def to_meshio(simulation: Simulation) -> meshio.Mesh:
    import meshio

    pad = [(0, 0), (0, 3 - simulation.dimension)]
    x = np.pad(simulation.positions, pad)
    return meshio.Mesh(
        x,
        [("tetra" if simulation.dimension == 3 else "triangle", simulation.cells)],
        point_data={
            "displacement": x - np.pad(simulation.rest_positions, pad),
            "velocity": np.pad(simulation.velocities, pad),
        },
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
    mesh = dolfinx.mesh.create_mesh(comm, simulation.cells.astype(np.int64), simulation.rest_positions, domain)
    vertex = np.asarray(mesh.geometry.input_global_indices)  # of ours, by node of theirs
    ours = np.asarray(mesh.topology.original_cell_index)
    linear = dolfinx.fem.VectorFunctionSpace(mesh, ("Lagrange", 1))
    constant = dolfinx.fem.FunctionSpace(mesh, ("DG", 0))
    # Dofs of a linear space are numbered cell by cell as the nodes of the geometry, but not always with their numbers.
    nodes, dofs = mesh.geometry.dofmap.array, linear.dofmap.list.array
    functions = {}
    for name, values in (
        ("displacement", simulation.positions - simulation.rest_positions),
        ("velocity", simulation.velocities),
    ):
        functions[name] = dolfinx.fem.Function(linear, name=name)
        functions[name].x.array.reshape(-1, d)[dofs] = values[vertex[nodes]]
    functions["elastic_density"] = dolfinx.fem.Function(constant, name="elastic_density")
    functions["elastic_density"].x.array[constant.dofmap.list.array] = simulation.elastic_density[ours]
    return mesh, functions
