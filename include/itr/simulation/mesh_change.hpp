// SPDX-License-Identifier: MIT
// What a program has to know of a changed mesh to carry its own data along.
#pragma once

#include <Eigen/SparseCore>
#include <map>
#include <vector>

#include "itr/mesh/mesh.hpp"
#include "itr/projection/transfer.hpp"

namespace itr {

/// What became of the ids of a compact mesh: the new id, kNone where it is gone. Entries after those of the old mesh are of
/// what was made meanwhile.
struct MeshRenumbering {
  std::vector<VertexId> vertex;
  std::vector<CellId> cell;
  std::vector<FacetId> facet;
  bool empty() const { return vertex.empty(); }
};
/// The same of two changes one after the other, of a mesh of so many vertices, cells and facets before the first.
MeshRenumbering compose(const MeshRenumbering& first, const MeshRenumbering& second);

/// From one compact mesh of a domain to another. Cells and facets that have a new id kept their vertices; a vertex that has
/// one may have moved at rest, where remeshing smooths.
template <int Dim>
struct MeshChange {
  std::vector<VertexId> vertex;  ///< by old id: the new one, kNone where it is gone
  std::vector<CellId> cell;
  std::vector<FacetId> facet;
  std::vector<FacetId> facet_parent;  ///< by new facet: the old one that its middle lies on, of the same tag
  TouchedCells touched;               ///< the cells by which the meshes differ
  /// A row for each new vertex, a column for each old one: values at its rest position of a function that is linear on the
  /// old cells (of its body). Rows sum to 1; those of vertices that stayed have one entry, 1.
  Eigen::SparseMatrix<double, Eigen::RowMajor> interpolation;
};

template <int Dim>
MeshChange<Dim> describe_change(const Mesh<Dim>& before, const Mesh<Dim>& mesh, const MeshRenumbering& renumbering);

/// L2 projection of nodal fields, a column each: rows by old vertex in, by new vertex out. Keeps the integrals of rho u and
/// rho X u over each connected part. `density` by body [kg/m^Dim]; bodies that are not in it have 1. (Interpolation, the
/// other choice, keeps bounds and not integrals.)
template <int Dim>
MatrixX project_fields(const Mesh<Dim>& before, const Mesh<Dim>& mesh, const MeshChange<Dim>& change, const MatrixX& fields,
                       const std::map<int, double>& density = {});

}  // namespace itr
