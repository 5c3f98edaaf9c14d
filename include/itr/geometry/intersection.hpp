// SPDX-License-Identifier: MIT
// Intersections of simplices, for exact integration on the common refinement of two meshes.
#pragma once

#include <array>
#include <vector>

#include "itr/core/types.hpp"

namespace itr {

/// A simplex decomposition of the intersection of two simplices of positive volume: appends to `pieces` simplices of
/// positive volume whose volumes sum to that of the intersection to round-off. Pieces smaller than round-off of the
/// inputs' volume are dropped.
template <int Dim>
void intersect_simplices(const std::array<Vec<Dim>, Dim + 1>& a, const std::array<Vec<Dim>, Dim + 1>& b,
                         std::vector<std::array<Vec<Dim>, Dim + 1>>& pieces);

}  // namespace itr
