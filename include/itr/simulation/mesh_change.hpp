// SPDX-License-Identifier: MIT
// Maps and transfer operators from an old mesh to a new one, for data of a program.
#pragma once

#include <Eigen/SparseCore>
#include <map>
#include <vector>

#include "itr/mesh/mesh.hpp"
#include "itr/projection/transfer.hpp"

namespace itr {

/// New ids of a compact mesh by old id, kNone for an entity that is gone. Entries beyond those of the old mesh belong to
/// entities that were made meanwhile.
struct MeshRenumbering {
  std::vector<VertexId> vertex;
  std::vector<CellId> cell;
  std::vector<FacetId> facet;
  bool empty() const { return vertex.empty(); }
};
/// Composes two changes, of a mesh with the given numbers of vertices, cells and facets before the first.
MeshRenumbering compose(const MeshRenumbering& first, const MeshRenumbering& second);

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
MeshChange<Dim> describe_change(const Mesh<Dim>& before, const Mesh<Dim>& mesh, const MeshRenumbering& renumbering);

/// Projects nodal fields in L2: a row for each old vertex in, for each new vertex out, one column a field. Keeps the
/// integrals of rho u and rho X u over each connected part. `density` is by body [kg/m^Dim], 1 for bodies that are not
/// listed. Interpolation keeps bounds instead of integrals.
template <int Dim>
MatrixX project_fields(const Mesh<Dim>& before, const Mesh<Dim>& mesh, const MeshChange<Dim>& change, const MatrixX& fields,
                       const std::map<int, double>& density = {});

}  // namespace itr
