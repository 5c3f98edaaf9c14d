// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <vector>

#include "itr/mesh.hpp"

namespace itr {

/// The cells around an edge a-b of a tetrahedral mesh in cyclic order. cells[i] holds a, b, vertices[i] and the vertex after
/// it, and is positively oriented in that order: seen with b in front of a, the ring runs counterclockwise.
struct EdgeRing {
  std::vector<VertexId> vertices;
  std::vector<CellId> cells;  ///< as many as vertices where the ring is closed, else one less
  bool closed = false;        ///< open at an edge of the boundary: first and last vertex are those of its two facets
};

/// Empty where the cells around the edge are not exactly one ring or one fan, or where there are none.
std::optional<EdgeRing> ring_of_edge(const Mesh<3>& mesh, const EdgeKey& edge);

}  // namespace itr
