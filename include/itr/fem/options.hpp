// SPDX-License-Identifier: MIT
#pragma once

namespace itr {

inline constexpr int kMostQuadratureDegree = 5;
inline constexpr int kElasticDegree = 2;  ///< exact for products of two gradients of quadratic functions

}  // namespace itr
