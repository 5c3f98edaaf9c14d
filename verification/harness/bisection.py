# SPDX-License-Identifier: MIT
"""Meshes that are fine where one says, by bisecting the longest edges of coarse ones; balls and discs, or parts of them, among them."""
import itertools

import numpy as np

from harness.scenes import oriented


def longest_edges(points, cells):
    """Of each cell: all its edges as keys (lower end * 2^32 + higher end), the longest one's key, corners and length. Of equally long
    ones it is that of the least key, so that neighbours agree."""
    pairs = np.array(list(itertools.combinations(range(cells.shape[1]), 2)))
    ends = np.sort(cells[:, pairs], axis=2)
    length = np.linalg.norm(points[ends[:, :, 0]] - points[ends[:, :, 1]], axis=2)
    keys = (ends[:, :, 0] << 32) + ends[:, :, 1]
    chosen = np.where(length >= length.max(axis=1, keepdims=True) * (1 - 1e-9), keys, np.iinfo(np.int64).max).argmin(axis=1)
    rows = np.arange(len(cells))
    return keys, keys[rows, chosen], pairs[chosen], length[rows, chosen]


def graded_mesh(points, cells, size, snap=lambda middles, a, b: middles):
    """Bisects the longest edges of cells until none is longer than size(barycentres). Cells at a cut edge are cut along their own
    longest edge first, so that the mesh stays conforming (Rivara 1984). `snap` moves new vertices, given their ends' places."""
    points, cells = np.array(points, dtype=float), np.array(cells, dtype=np.int64)
    middle_of = {}  # by key, of all edges that were ever cut: cells that still have one are cut there later
    while True:
        keys, longest, corners, length = longest_edges(points, cells)
        hanging = np.isin(keys, list(middle_of)).any(axis=1)
        cut = hanging if hanging.any() else length > size(points[cells].mean(axis=1))
        if not cut.any():
            return points, oriented(points, cells)
        new = np.array([key for key in np.unique(longest[cut]).tolist() if key not in middle_of], dtype=np.int64)
        a, b = points[new >> 32], points[new & (2**32 - 1)]
        middle_of.update(zip(new.tolist(), range(len(points), len(points) + len(new))))
        points = np.concatenate([points, snap((a + b) / 2, a, b)])
        middles = [middle_of[key] for key in longest[cut].tolist()]
        halves = [cells[cut], cells[cut]]
        for half, corner in zip(halves, corners[cut].T):
            half[np.arange(len(half)), corner] = middles
        cells = np.concatenate([cells[~cut], *halves])


def ball(radius, size, directions):
    """The part of a ball (or disc) about the origin that the corners [-1, 0, 1]^d of `directions` (k x d) span: one simplex a
    direction, from the centre, cut as graded_mesh does with new vertices of the surface on it."""
    places = {}
    number = lambda place: places.setdefault(tuple(place), len(places))
    cells = [[number(np.zeros(len(signs))), *(number(radius * corner) for corner in np.diag(signs))]
             for signs in np.array(directions, dtype=float)]

    def snap(middles, a, b):
        # Edges with both ends on the sphere are edges of the surface: each cell's vertices there are those of a facet.
        norm = lambda x: np.linalg.norm(x, axis=1, keepdims=True)
        outside = np.isclose(norm(a), radius, rtol=1e-9) & np.isclose(norm(b), radius, rtol=1e-9)
        return np.where(outside, middles * (radius / norm(middles)), middles)

    return graded_mesh(list(places), cells, size, snap)
