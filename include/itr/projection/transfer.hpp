// SPDX-License-Identifier: MIT
// L2 transfer of piecewise linear fields between two meshes of one domain (paper eq. 7), density-weighted so that
// momentum is kept, in the local form: M (u_new - u_bar) = A u_old - M u_bar has a right-hand side on touched cells only.
#pragma once

#include <span>
#include <vector>

#include "itr/core/types.hpp"

namespace itr {

/// A mesh as the transfer sees it: rest positions, cells, density of each cell.
template <int Dim>
struct TransferMesh {
  std::span<const Vec<Dim>> rest;                   ///< [m]
  std::span<const std::array<int, Dim + 1>> cells;  ///< positive volumes
  std::span<const double> density;                  ///< [kg/m^Dim] a cell
};

/// The cells by which the two meshes differ; they cover the same region on both sides. All other cells stand in both with
/// the same rest positions and (on the new mesh) u_bar equal to u_old at their vertices.
struct TouchedCells {
  std::vector<int> old_cells;
  std::vector<int> new_cells;
};

struct TransferReport {
  int iterations = 0;  ///< of the conjugate gradients
  double relative_residual = 0;
  double l2_error_squared = 0;  ///< sum over columns of ||u_new - u_old||^2 in the density-weighted norm
};

/// A_ij = integral of rho_old phi_i^new phi_j^old over the intersections of touched cells, applied to columns of nodal
/// values: returns A u_old on the touched cells only. `u_old` is num_old_vertices x k, the result num_new_vertices x k.
template <int Dim>
MatrixX touched_cross_mass_product(const TransferMesh<Dim>& old_mesh, const TransferMesh<Dim>& new_mesh,
                                   const TouchedCells& touched, const MatrixX& u_old);

/// The same integral over one group of old and new cells that cover the same region, for a preview of a single edit:
/// fills `A` (new_vertices x old_vertices, local numbering).
/// Cells are given by their rest positions through local vertex indices.
template <int Dim>
void patch_cross_mass(const TransferMesh<Dim>& old_patch, const TransferMesh<Dim>& new_patch, MatrixX& A);

/// Density-weighted L2 projection in the local form. `u_bar` (num_new x k) starts as the interpolant; rows of `fixed`
/// vertices (one flag a new vertex) keep it. Solved by Jacobi-preconditioned conjugate gradients to round-off. Returns
/// u_new. With no touched cells u_bar is returned bit for bit.
template <int Dim>
MatrixX project_l2(const TransferMesh<Dim>& old_mesh, const TransferMesh<Dim>& new_mesh, const TouchedCells& touched,
                   const MatrixX& u_old, const MatrixX& u_bar, std::span<const char> fixed, TransferReport& report);

}  // namespace itr
