// SPDX-License-Identifier: MIT
// PolyFEM's collision meshes that the bodies' own boundary is cut into (docs/theory.md, "Cut boundaries").
#pragma once

#include <map>

#include "itr/setup.hpp"

namespace itr::scene {

/// How the boundary is cut: until no edge is longer than `longest`, or each edge into `parts`.
struct Cuts {
  double longest = 0;  ///< [m], where `parts` is 0
  int parts = 0;
};

/// The boundary of a compact mesh, cut into smaller triangles. A vertex in a facet follows the displacements of the facet's
/// nodes by their shape functions, those of curved edges included: `order` by body as in Setup::order.
CollisionProxy<3> tessellate(const Mesh<3>& mesh, const std::map<int, int>& order, const Cuts& cuts);

}  // namespace itr::scene
