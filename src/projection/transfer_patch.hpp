// SPDX-License-Identifier: MIT
// The part of two meshes on which a projection is done: what it costs follows the cells that an edit touched.
#pragma once

#include <map>
#include <vector>

#include "fem/cell_set.hpp"
#include "itr/options.hpp"
#include "itr/transfer.hpp"

namespace itr {

/// Some cells of a mesh with a numbering of their own.
template <int Dim>
struct TransferCells {
  std::vector<int> vertices;  ///< and nodes of curved edges: ids in fields
  std::vector<Vec<Dim>> rest;
  std::vector<std::array<int, Dim + 1>> cells;
  std::vector<double> density;
  std::vector<std::array<int, kQuadraticNodes<Dim>>> nodes{};  ///< of curved cells; this and the next empty: there are none
  std::vector<CurvedEdges> curved{};
  bool axisymmetric = false;

  TransferMesh<Dim> view() const { return {rest, cells, density, nodes, curved, axisymmetric}; }
  /// Adds a cell with these nodes, which are not read where `edges`, its curved ones, are none. `number(v)`: the number of a
  /// vertex or node, which adds new ones to `vertices`; their rest positions are the caller's.
  template <typename Number>
  void add(const std::array<VertexId, Dim + 1>& of_cell, const std::array<VertexId, kQuadraticNodes<Dim>>& nodes_of_cell,
           CurvedEdges edges, double density_of_cell, const Number& number);
  /// Rows of values at these vertices, of an interleaved field over the mesh.
  MatrixX gather(const VectorX& field) const;
};

template <int Dim>
template <typename Number>
void TransferCells<Dim>::add(const std::array<VertexId, Dim + 1>& of_cell,
                             const std::array<VertexId, kQuadraticNodes<Dim>>& nodes_of_cell, CurvedEdges edges,
                             double density_of_cell, const Number& number) {
  auto& cell = cells.emplace_back();
  for (std::size_t k = 0; k < cell.size(); ++k) cell[k] = number(of_cell[k]);
  density.push_back(density_of_cell);
  if (edges == 0 && curved.empty()) return;
  nodes.resize(cells.size());  // zeros at the straight cells before
  curved.resize(cells.size());
  if (edges == 0) return;
  for (std::size_t k = 0; k < nodes_of_cell.size(); ++k) nodes.back()[k] = number(nodes_of_cell[k]);
  curved.back() = edges;
}

template <int Dim>
struct TransferPatch {
  TransferCells<Dim> old_cells;  ///< the touched ones
  TransferCells<Dim> new_cells;  ///< the touched ones, then those around them
  TouchedCells touched;          ///< in these numberings
  std::vector<char> at_rim;      ///< by vertex of `new_cells`: it has cells outside the patch
  CellSet<Dim> cells;            ///< `new_cells` as energies see them
};

/// `touched` are cells of the two meshes, which are compact. Free to move are the vertices of touched cells and those up to
/// `rings` edges away, and the nodes of edges of which all cells are in the patch.
template <int Dim>
TransferPatch<Dim> make_transfer_patch(const Mesh<Dim>& old_mesh, const Mesh<Dim>& mesh, const TouchedCells& touched,
                                       const std::map<int, Material>& materials, int rings);

}  // namespace itr
