// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Geometry>
#include <array>

#include "itr/types.hpp"

namespace itr {

/// Length of an edge or area of a triangle [m], [m^2].
inline double facet_area(const std::array<Vec<2>, 2>& p) { return (p[1] - p[0]).norm(); }
inline double facet_area(const std::array<Vec<3>, 3>& p) { return 0.5 * (p[1] - p[0]).cross(p[2] - p[0]).norm(); }

}  // namespace itr
