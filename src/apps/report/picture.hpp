// SPDX-License-Identifier: MIT
// Pictures of stored frames, for where a page cannot draw: no WebGL, no scripts.
#pragma once

#include <array>
#include <string>

#include "output/frame_file.hpp"

namespace itr::output {

/// From dark blue to yellow, as red, green, blue at equal distances (matplotlib's viridis, 9 of its colours).
inline constexpr std::array<std::array<int, 3>, 9> kColourMap = {{{68, 1, 84},
                                                                  {71, 44, 122},
                                                                  {59, 81, 139},
                                                                  {44, 113, 142},
                                                                  {33, 144, 141},
                                                                  {39, 173, 129},
                                                                  {92, 200, 99},
                                                                  {170, 220, 50},
                                                                  {253, 231, 37}}};

/// Angles from which solids are seen [degree]: about the y axis from z, and above the plane.
inline constexpr double kAzimuth = 35, kElevation = 20;

/// PNG of the bodies' surface, or cells in 2D, coloured by values of cells, and of obstacles; `low` and `high`: the box to
/// be seen [m].
std::string draw_frame(const StoredFrame& frame, const std::vector<double>& cell_values, double largest,
                       const std::vector<int>& cells_of_facets, const std::array<double, 3>& low,
                       const std::array<double, 3>& high, int width, int height);

}  // namespace itr::output
