// SPDX-License-Identifier: MIT
// Cells with curved edges as XDMF and VTK draw them.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "itr/mesh.hpp"

namespace itr::output {

/// Edges of a simplex as XDMF and VTK order the nodes on them.
template <int Dim>
constexpr auto drawn_edges() {
  if constexpr (Dim == 2)
    return std::array<std::array<int, 2>, 3>{{{0, 1}, {1, 2}, {0, 2}}};
  else
    return std::array<std::array<int, 2>, 6>{{{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}}};
}

/// Cells as XDMF and VTK draw them, each with a node at each of its edges: where only some edges are curved the straight
/// ones get nodes too, that only the drawing has.
template <int Dim>
struct DrawnCells {
  std::vector<EdgeKey> straight_edges;
  std::vector<std::int64_t> cells;  ///< rows of nodes

  /// A field with its values on the straight edges.
  VectorX at_nodes(ConstVectorView field) const {
    VectorX values(field.size() + Dim * static_cast<Eigen::Index>(straight_edges.size()));
    values.head(field.size()) = field;
    for (Eigen::Index i = field.size(); const auto& [a, b] : straight_edges) {
      values.template segment<Dim>(i) = (field.template segment<Dim>(Dim * a) + field.template segment<Dim>(Dim * b)) / 2;
      i += Dim;
    }
    return values;
  }
};

/// Numbers by node with those on the straight edges, the means of their ends.
template <int Dim>
VectorX numbers_at_nodes(const DrawnCells<Dim>& drawn, ConstVectorView numbers) {
  VectorX all(numbers.size() + static_cast<Eigen::Index>(drawn.straight_edges.size()));
  all.head(numbers.size()) = numbers;
  for (Eigen::Index i = numbers.size(); const auto& [a, b] : drawn.straight_edges) all[i++] = (numbers[a] + numbers[b]) / 2;
  return all;
}

template <int Dim>
DrawnCells<Dim> draw_cells(const Mesh<Dim>& mesh) {
  DrawnCells<Dim> drawn;
  for (const EdgeKey& edge : mesh.edges())
    if (mesh.node_of(edge) == kNone) drawn.straight_edges.push_back(edge);
  const auto number = [&](const EdgeKey& edge) {
    const auto& all = drawn.straight_edges;
    return mesh.num_nodes() + static_cast<int>(std::lower_bound(all.begin(), all.end(), edge) - all.begin());
  };
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    const auto& cell = mesh.cell(c);
    drawn.cells.insert(drawn.cells.end(), cell.begin(), cell.end());
    for (const auto& [i, j] : drawn_edges<Dim>()) {
      const int curved = mesh.node_of(cell[i], cell[j]);
      drawn.cells.push_back(curved != kNone ? curved : number(edge_key(cell[i], cell[j])));
    }
  }
  return drawn;
}

}  // namespace itr::output
