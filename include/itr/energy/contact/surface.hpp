// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <vector>

#include "itr/core/types.hpp"

namespace itr {

/// The primitives that can touch: surfaces of all bodies, and obstacles. Vertices carry the ids of the problem they are part
/// of (the whole scene or a patch), and the per-vertex arrays have one entry for every vertex of that problem.
struct CollisionSurface {
  std::vector<int> vertices;              ///< those on the surface
  std::vector<std::array<int, 2>> edges;  ///< surface edges, smaller id first, ascending
  std::vector<double> area;  ///< by problem vertex: half the rest lengths of the incident edges (1: codimensional)
  std::vector<int> degree;   ///< by problem vertex: incident edges on the *whole* surface
  /// By problem vertex: whether pairs with it count. False for obstacles, and around a patch for vertices whose contacts
  /// the patch cannot change.
  std::vector<char> counts;
};

}  // namespace itr
