# SPDX-License-Identifier: MIT
"""Splits quadrilaterals, hexahedra, prisms and pyramids of a mesh file into triangles and tetrahedra, and takes the corners of
elements of second order: python3 -m itr.simplices IN OUT.msh (reads and writes by meshio; sets become physical groups)."""

from __future__ import annotations

import re
import sys
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import meshio

Array = np.ndarray
# Faces of cells with three or four corners, by corners.
FACES = {
    "quad": [(0, 1, 2, 3)],
    "hexahedron": [(0, 3, 2, 1), (4, 5, 6, 7), (0, 1, 5, 4), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)],
    "wedge": [(0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)],
    "pyramid": [(0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)],
}
CORNERS = {"vertex": 1, "line": 2, "triangle": 3, "quad": 4, "tetra": 4, "pyramid": 5, "wedge": 6, "hexahedron": 8}
SIMPLEX = {"vertex": "vertex", "line": "line", "triangle": "triangle", "quad": "triangle"}
DIMENSION = {"vertex": 0, "line": 1, "triangle": 2, "tetra": 3}


def triangles_of(face: tuple[int, ...]) -> list[tuple[int, ...]]:
    """A face with the diagonal from its corner of the lowest number: cells on both sides choose the same."""
    if len(face) == 3:
        return [face]
    at = face.index(min(face))
    a, b, c, d = face[at:] + face[:at]
    return [(a, b, c), (a, c, d)]


def simplices_of(kind: str, cell: list[int]) -> list[tuple[int, ...]]:
    """A cell as triangles or tetrahedra: from its corner of the lowest number to the faces that do not have it."""
    faces = [tuple(cell[i] for i in face) for face in FACES[kind]]
    if kind == "quad":
        return triangles_of(faces[0])
    apex = min(cell)
    return [(triangle[0], triangle[2], triangle[1], apex) for face in faces if apex not in face for triangle in triangles_of(face)]


def split(mesh: meshio.Mesh) -> meshio.Mesh:
    """The mesh with simplices of first order in place of all cells. Sets of cells and physical groups stay; sets of points
    become sets of the vertices that are left."""
    import meshio

    blocks, origins = [], []
    for block in mesh.cells:
        kind = re.sub(r"\d+$", "", block.type)
        if kind not in CORNERS:
            raise SystemExit(f"found cells of type {block.type}; expected {', '.join(CORNERS)}")
        corners = np.asarray(block.data)[:, : CORNERS[kind]]
        parts = [[tuple(c)] for c in corners.tolist()]
        if kind in FACES:
            parts = [simplices_of(kind, cell) for cell in corners.tolist()]
        blocks.append((SIMPLEX.get(kind, "tetra"), np.array([simplex for part in parts for simplex in part], int)))
        origins.append(np.repeat(np.arange(len(parts)), [len(part) for part in parts]))
    used = np.unique(np.concatenate([data.ravel() for _, data in blocks]))
    new = np.full(len(mesh.points), -1)
    new[used] = np.arange(len(used))
    data = {name: [np.asarray(values)[origin] for values, origin in zip(arrays, origins)] for name, arrays in mesh.cell_data.items()}
    cell_sets = {
        name: [np.flatnonzero(np.isin(origin, chosen)) if chosen is not None else [] for chosen, origin in zip(chosen_by_block, origins)]
        for name, chosen_by_block in mesh.cell_sets.items()
        if not name.startswith("gmsh:")
    }
    point_sets = {name: new[np.asarray(points, int).ravel()] for name, points in mesh.point_sets.items()}
    return meshio.Mesh(
        mesh.points[used],
        [(kind, new[cells]) for kind, cells in blocks],
        cell_data={name: arrays for name, arrays in data.items() if name.startswith("gmsh:") or name == "medit:ref"},
        field_data=mesh.field_data,
        cell_sets=cell_sets,
        point_sets={name: points[points >= 0] for name, points in point_sets.items()},
    )


def write(mesh: meshio.Mesh, path: str) -> None:
    """Writes the mesh as Gmsh's 2.2, in which an element stands once for each of its groups. Sets of points become groups of
    points."""
    groups: dict[tuple[int, str], int] = {}
    rows = []
    types = {"vertex": 15, "line": 1, "triangle": 2, "tetra": 4}
    names = {(int(dim), int(tag)): name for name, (tag, dim) in mesh.field_data.items()}
    physical = mesh.cell_data.get("gmsh:physical")

    def number(dim: int, name: str) -> int:
        if (dim, name) not in groups:
            taken = {tag for (d, _), tag in groups.items() if d == dim} | {tag for d, tag in names if d == dim}
            groups[dim, name] = max(taken, default=0) + 1
        return groups[dim, name]

    for b, block in enumerate(mesh.cells):
        dim = DIMENSION[block.type]
        of_cell: list[list[int]] = [[] for _ in block.data]
        if physical is not None:
            for i, tag in enumerate(physical[b].tolist()):
                of_cell[i] += [int(tag)] if tag else []
        for name, chosen in mesh.cell_sets.items():
            for i in np.asarray(chosen[b], int).tolist():
                of_cell[i].append(number(dim, name))
        for cell, tags in zip(block.data.tolist(), of_cell):
            rows += [(types[block.type], tag, cell) for tag in (tags or [0])]
    for name, points in mesh.point_sets.items():
        rows += [(types["vertex"], number(0, name), [int(point)]) for point in points]
    all_names = [(dim, tag, name) for (dim, name), tag in groups.items()] + [(dim, tag, name) for (dim, tag), name in names.items()]
    with open(path, "w") as out:
        out.write("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n")
        if all_names:
            out.write(f"$PhysicalNames\n{len(all_names)}\n")
            out.writelines(f'{dim} {tag} "{name}"\n' for dim, tag, name in sorted(all_names))
            out.write("$EndPhysicalNames\n")
        points = np.pad(mesh.points, [(0, 0), (0, 3 - mesh.points.shape[1])])
        out.write(f"$Nodes\n{len(points)}\n")
        out.writelines(f"{i + 1} {x!r} {y!r} {z!r}\n" for i, (x, y, z) in enumerate(points.tolist()))
        out.write(f"$EndNodes\n$Elements\n{len(rows)}\n")
        out.writelines(f"{i + 1} {kind} 2 {tag} {tag} {' '.join(str(v + 1) for v in cell)}\n" for i, (kind, tag, cell) in enumerate(rows))
        out.write("$EndElements\n")


def main() -> None:
    if len(sys.argv) != 3 or not sys.argv[2].endswith(".msh"):
        raise SystemExit("usage: python3 -m itr.simplices IN OUT.msh")
    try:
        import meshio
    except ImportError:
        raise SystemExit("itr.simplices needs meshio: apt install python3-meshio, or pip install meshio") from None
    mesh = meshio.read(sys.argv[1])
    write(split(mesh), sys.argv[2])


if __name__ == "__main__":
    main()
