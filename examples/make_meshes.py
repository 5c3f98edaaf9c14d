#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Makes the meshes of the example scenes: near-equilateral triangulations of a beam, a square and a disc, a cube and a bar
of tetrahedra (Gmsh .msh 2.2), and Cook's membrane, a box, a line and a floor (.obj). The results are committed; run it again
after a change here.

usage: make_meshes.py [-o DIR]
"""

import argparse
import itertools
import pathlib

import numpy as np


def strip(lower, upper, key):
    """Triangles between two rows of vertex ids, both ascending in `key`: each step takes the shorter of the two diagonals."""
    triangles = []
    i = j = 0
    while i + 1 < len(lower) or j + 1 < len(upper):
        diagonal_up = abs(key[lower[i + 1]] - key[upper[j]]) if i + 1 < len(lower) else np.inf
        diagonal_down = abs(key[upper[j + 1]] - key[lower[i]]) if j + 1 < len(upper) else np.inf
        if diagonal_up <= diagonal_down:
            triangles.append((lower[i], lower[i + 1], upper[j]))
            i += 1
        else:
            triangles.append((lower[i], upper[j + 1], upper[j]))
            j += 1
    return triangles


def rectangle(width, height, h):
    """Rows of a triangular lattice with edges of about `h`, centred at the origin; odd rows are shifted by half an edge."""
    columns = round(width / h)
    num_rows = max(round(height / (h * np.sqrt(3) / 2)), 1)
    points, rows = [], []
    for r in range(num_rows + 1):
        x = np.linspace(-width / 2, width / 2, columns + 1)
        if r % 2:
            x = np.concatenate([x[:1], (x[1:] + x[:-1]) / 2, x[-1:]])
        y = -height / 2 + height * r / num_rows
        rows.append(np.arange(len(points), len(points) + len(x)))
        points += [(value, y) for value in x]
    points = np.array(points)
    triangles = [t for a, b in zip(rows, rows[1:]) for t in strip(a, b, points[:, 0])]
    return points, np.array(triangles)


def disc(radius, h):
    """Rings of 6, 12, 18, ... vertices around the centre: one sixth is a strip of a triangular lattice."""
    rings = max(round(radius / h), 1)
    points, ids = [(0.0, 0.0)], [np.array([0])]
    for r in range(1, rings + 1):
        angle = np.linspace(0, 2 * np.pi, 6 * r, endpoint=False)
        ids.append(np.arange(len(points), len(points) + len(angle)))
        points += [(radius * r / rings * np.cos(a), radius * r / rings * np.sin(a)) for a in angle]
    triangles = [(0, ids[1][k], ids[1][(k + 1) % 6]) for k in range(6)]
    for inner, outer in zip(ids[1:], ids[2:]):
        triangles += ring(inner, outer)
    return np.array(points), np.array(triangles)


def ring(inner, outer):
    """Triangles between two closed rings whose first vertices lie at the same angle."""
    n, m = len(inner), len(outer)
    triangles = []
    i = j = 0
    while i < n or j < m:
        if j < m and (i == n or (j + 1) * n <= (i + 1) * m):
            triangles.append((inner[i % n], outer[j], outer[(j + 1) % m]))
            j += 1
        else:
            triangles.append((inner[i], outer[j % m], inner[(i + 1) % n]))
            i += 1
    return triangles


def boxes(shape, extents):
    """`shape` boxes along the axes of a block centred at the origin, each cut into six tetrahedra around a diagonal."""
    shape, extents = np.array(shape), np.array(extents)
    counts = shape + 1
    number = np.arange(counts.prod()).reshape(counts)
    points = np.stack(np.unravel_index(number.ravel(), counts), axis=1) / shape * extents - extents / 2
    tetrahedra = []
    for i, j, k in np.ndindex(*shape):
        for a, b, c in itertools.permutations(np.eye(3, dtype=int)):
            corners = [(0, 0, 0), a, a + b, a + b + c]
            tetrahedron = [number[i + x, j + y, k + z] for x, y, z in corners]
            if np.linalg.det(np.stack([a, b, c])) < 0:
                tetrahedron[2:] = tetrahedron[:1:-1]
            tetrahedra.append(tetrahedron)
    return points, np.array(tetrahedra)


def check(points, triangles):
    """Positive areas, and every vertex used."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    ab, ac = b - a, c - a
    assert (ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0] > 0).all()
    assert len(np.unique(triangles)) == len(points)


def write_msh(path, points, cells):
    if points.shape[1] == 2:
        check(points, cells)
        points = np.pad(points, ((0, 0), (0, 1)))
    kind, name = (2, "triangles") if cells.shape[1] == 3 else (4, "tetrahedra")
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(points))]
    lines += [f"{k + 1} {x:.16g} {y:.16g} {z:.16g}" for k, (x, y, z) in enumerate(points)]
    lines += ["$EndNodes", "$Elements", str(len(cells))]
    lines += [f"{k + 1} {kind} 2 0 1 " + " ".join(str(v + 1) for v in cell) for k, cell in enumerate(cells)]
    path.write_text("\n".join(lines + ["$EndElements", ""]))
    print(f"{path}: {len(points)} vertices, {len(cells)} {name}")


def write_obj(path, points, faces=(), lines=()):
    text = ["v " + " ".join(f"{c:g}" for c in (*point, 0)[:3]) for point in points]
    text += ["f " + " ".join(str(v + 1) for v in face) for face in faces]
    text += ["l " + " ".join(str(v + 1) for v in line) for line in lines]
    path.write_text("\n".join(text) + "\n")
    print(path)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("-o", "--output", type=pathlib.Path, default=pathlib.Path(__file__).parent / "meshes")
    folder = parser.parse_args().output
    folder.mkdir(parents=True, exist_ok=True)
    write_msh(folder / "beam.msh", *rectangle(4, 0.5, 0.1))
    write_msh(folder / "square.msh", *rectangle(1, 1, 0.1))
    write_msh(folder / "disc.msh", *disc(0.5, 0.1))
    write_obj(folder / "cook.obj", [(0, 0), (48, 44), (48, 60), (0, 44)], faces=[(0, 1, 3), (1, 2, 3)])
    write_obj(folder / "box.obj", [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)], faces=[(0, 1, 2), (0, 2, 3)])
    write_msh(folder / "cube.msh", *boxes((3, 3, 3), (1, 1, 1)))
    write_msh(folder / "bar.msh", *boxes((12, 3, 3), (4, 1, 1)))
    write_obj(folder / "floor.obj", [(-1, 0, -1), (1, 0, -1), (1, 0, 1), (-1, 0, 1)], faces=[(0, 2, 1), (0, 3, 2)])
    write_obj(folder / "line.obj", [(-0.5, 0), (0.5, 0)], lines=[(0, 1)])


if __name__ == "__main__":
    main()
