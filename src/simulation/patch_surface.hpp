// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include "energy/contact/surface.hpp"
#include "itr/setup.hpp"
#include "projection/transfer_patch.hpp"

namespace itr {

/// Surface that vertices of a patch can touch on their way: their own facets, and all facets and obstacles that come near
/// those.
template <int Dim>
struct PatchSurface {
  CollisionSurface surface;  ///< its vertices: those of the patch, then `others`
  std::vector<int> others;   ///< ids in fields over bodies and obstacles
  bool empty() const { return surface.vertices.empty(); }
};

/// `moving` by vertex of the patch; `x` over bodies and obstacles, where they go from there by `goal` (Dim a vertex of the
/// patch); `reach` is how near something has to come to count, d-hat [m]; `age`: how many steps ago bodies were at x.
template <int Dim>
PatchSurface<Dim> patch_surface(const Mesh<Dim>& mesh, const Obstacles<Dim>& obstacles, const TransferPatch<Dim>& patch,
                                const std::vector<char>& moving, const VectorX& x, const VectorX& goal, double reach,
                                int age);

}  // namespace itr
