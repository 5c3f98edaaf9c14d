// SPDX-License-Identifier: MIT
// Pairs that stop a motion, as linear bounds that a corrected motion has to keep.
#pragma once

#include <array>
#include <vector>

namespace itr {

/// Pairs that stop a motion dx, and their gaps linearised at its end.
struct BlockingPairs {
  /// sum of coefficient * (change of dx) over `dofs` >= missing: the gap at the end is as wide as asked.
  struct Bound {
    int size = 0;
    std::array<int, 12> dofs{};
    std::array<double, 12> coefficients{};
    double missing = 0;  ///< what the gap at the end of dx lacks [m]; negative where it is wider
  };
  std::vector<std::array<int, 3>> pairs;  ///< kind, first and second primitive
  std::vector<Bound> bounds;              ///< of each pair
};

}  // namespace itr
