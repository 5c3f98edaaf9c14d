// SPDX-License-Identifier: MIT
#pragma once

#include "itr/types.hpp"

namespace itr {

/// Change of gradients and energy at a solution by a source of errors, scaled.
struct SourceChange {
  VectorX all, contact, friction;
  double energy = 0;
};

}  // namespace itr
