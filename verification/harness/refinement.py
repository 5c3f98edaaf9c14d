# SPDX-License-Identifier: MIT
"""The common refinement of two simplicial meshes of one domain, by clipping in floating point: a misjudged corner costs a
piece of round-off volume."""
import numpy as np

from harness.fields import signed_volumes

# Clipping a simplex by a half-space: for k corners inside, the pieces in terms of (inside corner i) and (crossing i-o).
# The part of a simplex with k of n corners inside is a prism over the inside corners; a staircase cuts it.


def staircase(k, m):
    """Simplices of the product of simplices with k and m corners: monotone paths of pairs."""
    paths = [[(0, 0)]]
    for _ in range(k + m - 2):
        paths = [path + [step] for path in paths
                 for step in ((path[-1][0] + 1, path[-1][1]), (path[-1][0], path[-1][1] + 1)) if step[0] < k and step[1] < m]
    return paths


def clip(simplices, owners, normals, offsets):
    """The part of each simplex (N x d+1 x d) where normal . x >= offset (one half-space a simplex), cut into simplices.

    With k corners inside and m outside, that part is the simplex product of the inside corners with the m + 1 points
    {the corner itself, its crossings towards each outside corner}, so the staircase's paths give the pieces.
    """
    corners = simplices.shape[1]
    heights = np.einsum("nkd,nd->nk", simplices, normals) - offsets[:, None]
    order = np.argsort(heights < 0, axis=1, kind="stable")  # inside corners first
    simplices = np.take_along_axis(simplices, order[:, :, None], axis=1)
    heights = np.take_along_axis(heights, order, axis=1)
    inside = (heights >= 0).sum(axis=1)
    pieces, kept = [], []
    for k in range(1, corners + 1):
        these = np.flatnonzero(inside == k)
        if len(these) == 0:
            continue
        s, h = simplices[these], heights[these]

        def point(i, j):
            """Inside corner i, or its crossing on the way to outside corner j - 1."""
            if j == 0:
                return s[:, i]
            o = k + j - 1
            share = h[:, i] / (h[:, i] - h[:, o])
            return s[:, i] + share[:, None] * (s[:, o] - s[:, i])

        for path in staircase(k, corners - k + 1):
            pieces.append(np.stack([point(i, j) for i, j in path], axis=1))
            kept.append(owners[these])
    if not pieces:
        return simplices[:0], owners[:0]
    return np.concatenate(pieces), np.concatenate(kept)


def common_refinement(points_a, cells_a, points_b, cells_b):
    """Pieces (N x d+1 x d corners, positive volume) and for each its cell of a and of b."""
    a, b = points_a[cells_a], points_b[cells_b]
    touching = np.ones((len(a), len(b)), dtype=bool)
    for k in range(a.shape[2]):
        touching &= a[:, None, :, k].min(2) < b[None, :, :, k].max(2)
        touching &= a[:, None, :, k].max(2) > b[None, :, :, k].min(2)
    pairs = np.argwhere(touching)
    pieces, owners = a[pairs[:, 0]], np.arange(len(pairs))
    d = a.shape[2]
    # Inside cell b are the points whose barycentric coordinates are not negative.
    gradients = np.linalg.inv(b[:, 1:] - b[:, :1]).transpose(0, 2, 1)  # row k: gradient of coordinate k + 1
    gradients = np.concatenate([-gradients.sum(axis=1, keepdims=True), gradients], axis=1)
    origins = np.einsum("nkd,nd->nk", gradients, b[:, 0])
    origins[:, 0] -= 1
    for k in range(d + 1):
        cell = pairs[owners, 1]
        pieces, owners = clip(pieces, owners, gradients[cell, k], origins[cell, k])
    size = signed_volumes(pieces)
    smallest = 1e-14 * np.abs(signed_volumes(b)).min()
    pieces[size < 0, -2:] = pieces[size < 0, -2:][:, ::-1]
    keep = np.abs(size) > smallest
    return pieces[keep], pairs[owners[keep], 0], pairs[owners[keep], 1]


def evaluation(points, cells, owners, at):
    """Sparse matrix that evaluates a P1 field of (points, cells) at `at` (N x d), each point in cell owners[n]."""
    import scipy.sparse
    corners = points[cells[owners]]
    inverse = np.linalg.inv((corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1))
    weights = np.einsum("nkd,nd->nk", inverse, at - corners[:, 0])
    weights = np.concatenate([1 - weights.sum(axis=1, keepdims=True), weights], axis=1)
    rows = np.repeat(np.arange(len(at)), weights.shape[1])
    return scipy.sparse.csr_matrix((weights.ravel(), (rows, cells[owners].ravel())), shape=(len(at), len(points)))


def refine_some(points, cells, marked):
    """Longest-edge bisection of marked cells with the closure that keeps the mesh conforming (2D and 3D).
    Returns points, cells and for each cell the one that it is a part of."""
    parents = list(range(len(cells)))
    points, cells = [tuple(p) for p in points], [tuple(c) for c in cells]
    todo = {frozenset(cells[c]) for c in marked}
    midpoint = {}

    def longest(cell):
        return max(((i, j) for n, i in enumerate(cell) for j in cell[n + 1:]),
                   key=lambda e: (np.linalg.norm(np.subtract(points[e[0]], points[e[1]])), tuple(sorted(e))))

    split = {tuple(sorted(longest(tuple(c)))) for c in todo}
    while True:  # cells with a split edge are split along their own longest edge first
        bad = [c for c in cells if any((min(i, j), max(i, j)) in split for n, i in enumerate(c) for j in c[n + 1:])]
        if not bad:
            return np.array(points), np.array(cells), np.array(parents)
        split |= {tuple(sorted(longest(c))) for c in bad}
        done, of = [], []
        for cell, parent in zip(cells, parents):
            edge = longest(cell)
            key = tuple(sorted(edge))
            if key not in split:
                done.append(cell)
                of.append(parent)
                continue
            if key not in midpoint:
                midpoint[key] = len(points)
                points.append(tuple(np.add(points[edge[0]], points[edge[1]]) / 2))
            for end in edge:
                done.append(tuple(midpoint[key] if v == end else v for v in cell))
                of.append(parent)
        cells, parents = done, of
