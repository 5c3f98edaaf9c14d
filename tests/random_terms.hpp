// SPDX-License-Identifier: MIT
#pragma once

#include <rapidcheck/gtest.h>

#include "random_mesh.hpp"

namespace itr {

inline Terms draw_terms() {
  const auto flip = [] { return *rc::gen::arbitrary<bool>(); };
  Terms terms;
  for (bool* term : {&terms.friction, &terms.held, &terms.pressure, &terms.damping, &terms.second_body, &terms.lumped,
                     &terms.moving_obstacle})
    *term = flip();
  return terms;
}

}  // namespace itr
