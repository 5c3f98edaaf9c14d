// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include "itr/types.hpp"

namespace itr {

/// How a surface in 2D lies behind the boundary of the bodies (docs/theory.md, "Averaged gaps"), by vertex of the surface.
struct Retraction {
  std::vector<double> depth;      ///< at rest [m]
  std::vector<double> width;      ///< by how much averaged gaps may be negative [m]; 0: none is averaged here
  std::vector<char> is_corner;    ///< where the surface is not smooth
  std::vector<Vec<2>> rest;       ///< positions [m]
  std::vector<Vec<2>> outward;    ///< away from the body, at rest; of any length
  std::vector<double> stiffness;  ///< of the barrier of averaged gaps [Pa]
};

}  // namespace itr
