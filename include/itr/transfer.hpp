// SPDX-License-Identifier: MIT
// L2 transfer of piecewise linear and quadratic fields between two meshes of one domain (paper eq. 7). It is weighted by
// density, so that it keeps momentum. It is local: M (u_new - u_bar) = A u_old - M u_bar has a right-hand side on touched
// cells only.
//
// Maps and transfer operators from an old mesh to a new one, for data of a program.
#pragma once

#include <Eigen/SparseCore>
#include <array>
#include <map>
#include <span>
#include <vector>

#include "itr/mesh.hpp"
#include "itr/types.hpp"

namespace itr {

/// A mesh, or a patch of one, as plain arrays: rest positions, cells, density of each cell.
template <int Dim>
struct TransferMesh {
  std::span<const Vec<Dim>> rest;                   ///< of vertices and nodes [m]
  std::span<const std::array<int, Dim + 1>> cells;  ///< positive volumes
  std::span<const double> density;                  ///< [kg/m^Dim] a cell
  /// Nodes and curved edges of cells, as those of a CellSet; both empty where no edge is curved.
  std::span<const std::array<int, kQuadraticNodes<Dim>>> nodes{};
  std::span<const CurvedEdges> curved{};
  bool axisymmetric = false;  ///< integrals are weighted by 2 pi R, too (Mesh::is_axisymmetric)

  CurvedEdges curved_edges(std::size_t cell) const { return curved.empty() ? CurvedEdges{0} : curved[cell]; }
};

/// By vertex and node: the number of the connected part that it belongs to.
template <int Dim>
ITR_EXPORT std::vector<int> parts_of(const TransferMesh<Dim>& mesh);

/// The cells by which two meshes differ. They cover the same region in both. All other cells are the same in both meshes,
/// and u_bar equals u_old at their vertices.
struct TouchedCells {
  std::vector<int> old_cells;
  std::vector<int> new_cells;
};

struct TransferReport {
  int iterations = 0;  ///< of the conjugate gradients
  double relative_residual = 0;
  double l2_error_squared = 0;  ///< sum over columns of ||u_new - u_old||^2 in the density-weighted norm
  VectorX lost;                 ///< integral of rho (u_old - u_new) by column; 0 to round-off unless all vertices are fixed
};

/// The difference u_old - u_bar, integrated over the intersections of old and new touched cells, by column.
struct TouchedDifference {
  MatrixX residual;  ///< num_new_vertices x k: integral of rho phi_i^new (u_old - u_bar)
  VectorX squares;   ///< integral of rho (u_old - u_bar)^2
};
template <int Dim>
ITR_EXPORT TouchedDifference touched_difference(const TransferMesh<Dim>& old_mesh, const TransferMesh<Dim>& new_mesh,
                                                const TouchedCells& touched, const MatrixX& u_old, const MatrixX& u_bar);

/// Returns the correction d = u_new - u_bar for a residual of touched_difference. d minimises ||u_new - u_old||, vanishes
/// where `fixed` is set, and keeps the integrals of rho u and rho X u over each connected part of the mesh. `fixed` has a
/// flag for each entry, row by row; empty means that nothing is fixed. Without fixed entries d gives the L2 projection,
/// which keeps the integrals by itself. With fixed entries (the rim of a patch, a held boundary) constraints keep them,
/// those of rho u alone where too few vertices are free. Conjugate gradients solve to round-off.
template <int Dim>
ITR_EXPORT MatrixX solve_projection(const TransferMesh<Dim>& mesh, const MatrixX& residual, std::span<const char> fixed,
                                    TransferReport& report);

/// Returns u_new = u_bar + d, num_new_vertices x k, for `u_old` (num_old_vertices x k) and `u_bar` (num_new_vertices x k).
/// Without touched cells it returns u_bar bit for bit.
template <int Dim>
ITR_EXPORT MatrixX project_l2(const TransferMesh<Dim>& old_mesh, const TransferMesh<Dim>& new_mesh,
                              const TouchedCells& touched, const MatrixX& u_old, const MatrixX& u_bar,
                              std::span<const char> fixed, TransferReport& report);

/// Returns d^T M d for each column d, with the consistent mass M.
template <int Dim>
ITR_EXPORT VectorX mass_squares(const TransferMesh<Dim>& mesh, const MatrixX& d);

/// Composes two changes, of a mesh with the given numbers of vertices, cells and facets before the first.
ITR_EXPORT MeshRenumbering compose(const MeshRenumbering& first, const MeshRenumbering& second);

/// The change from one compact mesh of a domain to another. Cells and facets with a new id kept their vertices. A vertex
/// with a new id may have moved at rest, if remeshing smooths.
template <int Dim>
struct MeshChange {
  std::vector<VertexId> vertex;  ///< by old id: the new one, kNone where it is gone
  std::vector<CellId> cell;
  std::vector<FacetId> facet;
  std::vector<FacetId> facet_parent;  ///< by new facet: the old facet with the same tag on which its middle lies
  TouchedCells touched;               ///< the cells by which the meshes differ
  /// Interpolation at the new vertices, with a row for each new vertex and a column for each old one. The function is linear
  /// on the old cells of the vertex's body. Rows sum to 1; the row of a vertex that stayed has a single entry.
  Eigen::SparseMatrix<double, Eigen::RowMajor> interpolation;
};

template <int Dim>
ITR_EXPORT MeshChange<Dim> describe_change(const Mesh<Dim>& before, const Mesh<Dim>& mesh,
                                           const MeshRenumbering& renumbering);

/// Projects nodal fields in L2: a row for each old vertex in, for each new vertex out, one column a field. Keeps the
/// integrals of rho u and rho X u over each connected part. `density` is by body [kg/m^Dim], 1 for bodies that are not
/// listed. Interpolation keeps bounds instead of integrals.
template <int Dim>
ITR_EXPORT MatrixX project_fields(const Mesh<Dim>& before, const Mesh<Dim>& mesh, const MeshChange<Dim>& change,
                                  const MatrixX& fields, const std::map<int, double>& density = {});

}  // namespace itr
