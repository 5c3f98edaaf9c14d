// SPDX-License-Identifier: MIT
#pragma once

#include "itr/types.hpp"

namespace itr {

/// How velocities follow from positions within a step: v = rate * (x - reference).
struct VelocityRule {
  double rate = 1;    ///< dv/dx [1/s]
  VectorX reference;  ///< [m]
};

}  // namespace itr
