// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Geometry>

#include "itr/types.hpp"

namespace itr {

/// Moment of a force, or of a momentum, at the end of an arm; 2D: about the axis out of the plane.
inline Vec<1> moment(const Vec<2>& arm, const Vec<2>& f) { return Vec<1>(arm[0] * f[1] - arm[1] * f[0]); }
inline Vec<3> moment(const Vec<3>& arm, const Vec<3>& f) { return arm.cross(f); }

}  // namespace itr
