# SPDX-License-Identifier: MIT
"""The density-weighted L2 projection of P1 fields between meshes, by FEniCSx on the exact common refinement."""
import numpy as np
import scipy.sparse.linalg

from harness.fenicsx import scalar_mass
from harness.fields import signed_volumes
from harness.refinement import common_refinement, evaluation


class Projection:
    """From mesh `old` to mesh `new`, each (points, cells), of one domain, with densities by cell."""

    def __init__(self, old, new, old_density, new_density):
        pieces, in_old, in_new = common_refinement(*old, *new)
        corners = pieces.shape[1]
        points, cells = pieces.reshape(-1, corners - 1), np.arange(corners * len(pieces)).reshape(-1, corners)
        self.new_points = new[0]
        self.mass = scalar_mass(*new, new_density)
        self.covered = signed_volumes(pieces).sum() / signed_volumes(new[0][new[1]]).sum()  # 1, or the refinement misses something
        pieces_mass = scalar_mass(points, cells, np.asarray(old_density)[in_old])
        self.weigh_old = pieces_mass @ evaluation(*old, np.repeat(in_old, corners), points)
        self.cross = evaluation(*new, np.repeat(in_new, corners), points).T @ self.weigh_old

    def __call__(self, field, fixed=None, values=None):
        """The projection of `field` (a row a vertex of the old mesh); rows of `fixed` vertices (flags) have `values`, and the
        others keep the integrals of density * u and of density * position * u, which held vertices would else change."""
        rhs = self.cross @ field
        if fixed is None or not fixed.any():
            return scipy.sparse.linalg.spsolve(self.mass.tocsc(), rhs)
        free = ~fixed
        result = np.array(values, dtype=float)
        missing = rhs - self.mass[:, fixed] @ result[fixed]
        solve = scipy.sparse.linalg.splu(self.mass[free][:, free].tocsc()).solve
        moments = np.column_stack([np.ones(len(self.new_points)), self.new_points - self.new_points.mean(axis=0)])
        weights = (self.mass @ moments)[free]
        result[free], ways = solve(missing[free]), solve(weights)
        result[free] += ways @ np.linalg.solve(weights.T @ ways, moments.T @ missing - weights.T @ result[free])
        return result

    def integral_old(self, field):
        """The integral of density * field over the body, by component."""
        return np.asarray(self.weigh_old.sum(axis=0)).ravel() @ field

    def integral_new(self, field):
        return np.asarray(self.mass.sum(axis=0)).ravel() @ field
