# SPDX-License-Identifier: MIT
"""Integrals over P1 meshes in numpy, for cases without a finite-element reference."""
import math

import numpy as np

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
    """Gradient of a field (a row a vertex) in each cell: m x components x dim."""
    edges = points[cells[:, 1:]] - points[cells[:, :1]]
    return np.linalg.solve(edges, u[cells[:, 1:]] - u[cells[:, :1]]).transpose(0, 2, 1)


def errors(points, cells, u, exact, exact_gradient):
    """L2 norms of the difference to a function of points (n x d -> n x d) and of its gradient (-> n x d x d)."""
    barycentric, weights = simplex_rule(points.shape[1])
    size = volumes(points, cells)
    slope = gradients(points, cells, u)
    value = semi = 0.0
    for b, w in zip(barycentric, weights):
        X = np.einsum("k,mkd->md", b, points[cells])
        value += w * size @ ((np.einsum("k,mkd->md", b, u[cells]) - exact(X))**2).sum(axis=1)
        semi += w * size @ ((slope - exact_gradient(X))**2).sum(axis=(1, 2))
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
