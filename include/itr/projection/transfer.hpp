// SPDX-License-Identifier: MIT
// L2 transfer of piecewise linear fields between two meshes of one domain (paper eq. 7), density-weighted so that
// momentum is kept, in the local form: M (u_new - u_bar) = A u_old - M u_bar has a right-hand side on touched cells only.
#pragma once

#include <span>
#include <vector>

#include "itr/core/types.hpp"
#include "itr/fem/mass.hpp"

namespace itr {

/// A mesh, or a patch of one, as the transfer sees it: rest positions, cells, density of each cell.
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
  VectorX lost;                 ///< by column: integral of rho (u_old - u_new), 0 to round-off unless all vertices are fixed
};

/// What u_bar lacks of u_old, integrated over the intersections of old and new touched cells, by columns.
struct TouchedDifference {
  MatrixX residual;  ///< num_new_vertices x k: integral of rho phi_i^new (u_old - u_bar)
  VectorX squares;   ///< integral of rho (u_old - u_bar)^2
};
template <int Dim>
TouchedDifference touched_difference(const TransferMesh<Dim>& old_mesh, const TransferMesh<Dim>& new_mesh,
                                     const TouchedCells& touched, const MatrixX& u_old, const MatrixX& u_bar);

/// The correction d = u_new - u_bar for a residual as above: least ||u_new - u_old|| among those that vanish where
/// `fixed` (a flag for each entry, row by row; empty: nowhere) and that keep the integrals of rho u and rho X u over each
/// connected part of the mesh. Where nothing is fixed that is the L2 projection, which keeps them anyhow; where the mesh
/// is a patch, fixed at its rim, or a boundary is held, they are kept by constraints (of rho u alone where too few vertices
/// are free). Conjugate gradients to round-off.
template <int Dim>
MatrixX solve_projection(const TransferMesh<Dim>& mesh, const MatrixX& residual, std::span<const char> fixed,
                         TransferReport& report);

/// Both: u_new = u_bar + d. `u_old` is num_old_vertices x k, `u_bar` num_new_vertices x k. With no touched cells u_bar is
/// returned bit for bit.
template <int Dim>
MatrixX project_l2(const TransferMesh<Dim>& old_mesh, const TransferMesh<Dim>& new_mesh, const TouchedCells& touched,
                   const MatrixX& u_old, const MatrixX& u_bar, std::span<const char> fixed, TransferReport& report);

/// By column, d^T M d with the consistent mass.
template <int Dim>
VectorX mass_squares(const TransferMesh<Dim>& mesh, const MatrixX& d);

}  // namespace itr
