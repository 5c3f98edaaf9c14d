// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <vector>

#include "itr/types.hpp"

namespace itr::output {

/// Hausdorff distance of two surfaces, each given by the corners of its facets (edges in 2D, triangles in 3D) [m]: from
/// below, to a thousandth of itself or a millionth of their extent, whichever is more; in 3D to a hundredth or a thousandth.
/// 0 where either is empty.
template <int Dim>
double surface_distance(const std::vector<std::array<Vec<Dim>, Dim>>& a, const std::vector<std::array<Vec<Dim>, Dim>>& b);

}  // namespace itr::output
