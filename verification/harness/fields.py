# SPDX-License-Identifier: MIT
"""Integrals over P1 meshes in numpy, for cases without a finite-element reference."""
import math

import numpy as np

from harness.scenes import EDGES

# Points in barycentric coordinates and weights (sum 1): Gauss-Legendre on the collapsed square or cube, exact to degree 7.


def simplex_rule(dim, order=5):
    x, w = np.polynomial.legendre.leggauss(order)
    x, w = (x + 1) / 2, w / 2
    points, weights = np.zeros((1, 0)), np.ones(1)
    for k in range(dim):  # stick breaking: the k-th coordinate takes a share of what is left
        left = 1 - points.sum(axis=1)
        power = dim - 1 - k
        points = np.concatenate([np.repeat(points, order, axis=0), (left[:, None] * x).reshape(-1, 1)], axis=1)
        weights = (weights[:, None] * (w * (1 - x)**power)).ravel()
    return np.concatenate([1 - points.sum(axis=1, keepdims=True), points], axis=1), weights * math.factorial(dim)


def signed_volumes(simplices):
    """Of N x d+1 x d corners."""
    return np.linalg.det(simplices[:, 1:] - simplices[:, :1]) / math.factorial(simplices.shape[2])


def volumes(points, cells):
    return np.abs(signed_volumes(points[cells]))


def gradients(points, cells, u):
    """Gradient of a linear field (a row a vertex) in each cell: m x components x dim. None: of the barycentric coordinates."""
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    if u is None:
        unit = np.eye(cells.shape[1])
        return np.linalg.solve(edges, np.broadcast_to(unit[1:] - unit[0], (len(cells), *unit[1:].shape))).transpose(0, 2, 1)
    return np.linalg.solve(edges, u[cells[:, 1:]] - u[cells[:, :1]]).transpose(0, 2, 1)


def shapes(order, b):
    """Values of the shape functions of a simplex at barycentric coordinates b, and their derivatives by these (a row each)."""
    if order == 1:
        return b, np.eye(len(b))
    edges = np.array(EDGES[len(b) - 1])
    i, j, unit = edges[:, 0], edges[:, 1], np.eye(len(b))
    values = np.concatenate([b * (2 * b - 1), 4 * b[i] * b[j]])
    slopes = np.concatenate([np.diag(4 * b - 1), 4 * (b[i][:, None] * unit[j] + b[j][:, None] * unit[i])])
    return values, slopes


def errors(points, cells, u, exact, exact_gradient, order=1):
    """L2 norms of the difference to a function of points (n x d -> n x d) and of its gradient (-> n x d x d). Of quadratic
    elements `cells` have the nodes of their edges too (scenes.with_edge_nodes)."""
    dim = points.shape[1]
    corners = cells[:, :dim + 1]
    barycentric, weights = simplex_rule(dim)
    size = volumes(points, corners)
    of_barycentric = gradients(points, corners, None)
    value = semi = 0.0
    for b, w in zip(barycentric, weights):
        X = np.einsum("k,mkd->md", b, points[corners])
        values, slopes = shapes(order, b)
        gradient = np.einsum("mnc,nk,mkd->mcd", u[cells], slopes, of_barycentric)
        value += w * size @ ((np.einsum("n,mnd->md", values, u[cells]) - exact(X))**2).sum(axis=1)
        semi += w * size @ ((gradient - exact_gradient(X))**2).sum(axis=(1, 2))
    return math.sqrt(value), math.sqrt(semi)


def consistent_mass_product(points, cells, density, v):
    """M v for a field v (a row a vertex)."""
    d = points.shape[1]
    local = v[cells]
    weighted = (density * volumes(points, cells) / ((d + 1) * (d + 2)))[:, None, None] * (local + local.sum(axis=1, keepdims=True))
    result = np.zeros_like(v)
    np.add.at(result, cells, weighted)
    return result


def fitted_order(sizes, values):
    """Exponent p of values ~ sizes^p by least squares."""
    return np.polyfit(np.log(sizes), np.log(values), 1)[0]
