// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>

#include "itr/mesh.hpp"

namespace itr {

template <std::size_t N>
bool holds(const std::array<int, N>& ids, int id) {
  return std::find(ids.begin(), ids.end(), id) != ids.end();
}

/// The cell that a boundary facet is of.
template <int Dim>
CellId cell_of_facet(const Mesh<Dim>& mesh, FacetId f) {
  const auto& facet = mesh.facet(f);
  return *std::ranges::find_if(mesh.cells_of(facet[0]), [&](CellId c) {
    return std::ranges::all_of(facet, [&](VertexId v) { return holds(mesh.cell(c), v); });
  });
}

}  // namespace itr
