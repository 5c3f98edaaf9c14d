#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Meshes of a rubber arch in millimetres, for docs/tutorial.md: arch.msh (triangles) and arch3d.msh (tetrahedra, 8 mm deep).

usage: arch.py [FOLDER]
"""

import math
import pathlib
import sys

INNER, OUTER, DEPTH = 6.0, 10.0, 8.0  # mm
AROUND, THROUGH, LAYERS = 16, 2, 3  # cells along the arch, through its thickness, in depth


def section():
    """Vertices and triangles of the half ring."""
    vertices = []
    for i in range(AROUND + 1):
        angle = math.pi * i / AROUND
        for j in range(THROUGH + 1):
            radius = INNER + (OUTER - INNER) * j / THROUGH
            vertices.append((radius * math.cos(angle), radius * math.sin(angle)))
    triangles = []
    for i in range(AROUND):
        for j in range(THROUGH):
            a = i * (THROUGH + 1) + j
            b, c, d = a + 1, a + THROUGH + 1, a + THROUGH + 2
            triangles += [(a, b, d), (a, d, c)] if i < AROUND // 2 else [(a, b, c), (b, d, c)]
    return vertices, triangles


def solid():
    """The section, pushed along z; each prism becomes three tetrahedra that fit to those of its neighbours."""
    flat, triangles = section()
    vertices = [(x, y, DEPTH * k / LAYERS) for k in range(LAYERS + 1) for x, y in flat]
    cells = []
    for k in range(LAYERS):
        for triangle in triangles:
            a, b, c = (v + k * len(flat) for v in sorted(triangle))
            n = len(flat)
            cells += [(a, b, c, c + n), (a, b, c + n, b + n), (a, b + n, c + n, a + n)]
    return vertices, [cell if volume(vertices, cell) > 0 else (cell[1], cell[0], *cell[2:]) for cell in cells]


def volume(vertices, cell):
    a, b, c, d = (vertices[v] for v in cell)
    u, v, w = ([p[i] - a[i] for i in range(3)] for p in (b, c, d))
    return sum(u[i] * (v[i - 2] * w[i - 1] - v[i - 1] * w[i - 2]) for i in range(3))


def write(path, vertices, cells):
    """Gmsh's format 2.2."""
    kind = {3: 2, 4: 4}[len(cells[0])]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(vertices))]
    lines += [" ".join(map(str, (i + 1, *v, *[0.0] * (3 - len(v))))) for i, v in enumerate(vertices)]
    lines += ["$EndNodes", "$Elements", str(len(cells))]
    lines += [" ".join(map(str, (i + 1, kind, 2, 1, 1, *[v + 1 for v in cell]))) for i, cell in enumerate(cells)]
    path.write_text("\n".join(lines + ["$EndElements", ""]))


if __name__ == "__main__":
    folder = pathlib.Path(sys.argv[1] if len(sys.argv) > 1 else ".")
    write(folder / "arch.msh", *section())
    write(folder / "arch3d.msh", *solid())
