# SPDX-License-Identifier: MIT
"""The contact barrier in its convergent form, from its formula (docs/theory.md, "Contact")."""
import numpy as np


def barrier_pressure(gap, dhat, kappa):
    """Pressure [Pa] of a surface on an obstacle without vertices near: pairs count half, the other half is the other side's."""
    D = gap**2
    slope = (dhat**2 - D) * (2 * np.log(D / dhat**2) - dhat**2 / D + 1)
    return np.where(gap < dhat, -kappa / 2 * slope * 2 * gap / dhat**3, 0.0)


def gap_of_pressure(pressure, dhat, kappa):
    low, high = 1e-12 * dhat, dhat
    for _ in range(200):
        middle = (low + high) / 2
        low, high = (middle, high) if barrier_pressure(middle, dhat, kappa) > pressure else (low, middle)
    return middle


def boundary_edges(cells):
    """Edges (k x 2) of one triangle only."""
    edges = np.concatenate([cells[:, [0, 1]], cells[:, [1, 2]], cells[:, [2, 0]]])
    _, first, count = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    return edges[first[count == 1]]


def vertex_lengths(rest, cells):
    """Half the lengths of the boundary edges at each vertex."""
    lengths = np.zeros(len(rest))
    edges = boundary_edges(cells)
    size = np.linalg.norm(rest[edges[:, 0]] - rest[edges[:, 1]], axis=1)
    np.add.at(lengths, edges, size[:, None] / 2)
    return lengths


def vertex_areas(rest, cells, chosen):
    """A third of the areas of the boundary triangles at each vertex, of those triangles whose vertices are all chosen."""
    faces = np.concatenate([np.delete(cells, k, axis=1) for k in range(4)])
    _, first, count = np.unique(np.sort(faces, axis=1), axis=0, return_index=True, return_counts=True)
    faces = faces[first[count == 1]]
    faces = faces[chosen[faces].all(axis=1)]
    sides = rest[faces[:, 1:]] - rest[faces[:, :1]]
    areas = np.zeros(len(rest))
    np.add.at(areas, faces, np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)[:, None] / 6)
    return areas


def write_line(path, *points):
    """A polyline as an obstacle's mesh."""
    path.write_text("".join(f"v {x:.17g} {y:.17g} 0\n" for x, y in points)
                    + "l " + " ".join(str(k + 1) for k in range(len(points))) + "\n")


def write_plane(path, height, size=40.0):
    """A level triangle as an obstacle's mesh, with its edges far from the origin."""
    path.write_text(f"v {-size} {-size} {height:.17g}\nv {3 * size} {-size} {height:.17g}\nv {-size} {3 * size} {height:.17g}\nf 1 2 3\n")


def with_obstacle(content, path, dhat, kappa, **contact):
    """A scene of harness.scenes.scene with a fixed obstacle and contact in the convergent form."""
    content["geometry"].append({"mesh": str(path), "is_obstacle": True, "surface_selection": 1000})
    return with_contact(content, dhat, kappa, **contact)


def with_contact(content, dhat, kappa, **contact):
    content["contact"] = {"enabled": True, "dhat": dhat, "use_convergent_formulation": True, **contact}
    content["solver"]["contact"] = {"barrier_stiffness": kappa, "friction_iterations": 50, "friction_convergence_tol": 1e-6}
    return content
