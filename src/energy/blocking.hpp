// SPDX-License-Identifier: MIT
// Pairs that stop a motion, as linear bounds that a corrected motion has to keep.
#pragma once

#include <array>
#include <vector>

namespace itr {

/// Pairs that stop a motion dx, and their gaps linearised at its end.
struct BlockingPairs {
  static constexpr std::size_t kMost = 128;  ///< a back-solve each

  /// sum of coefficient * (change of dx) over `dofs` >= missing: the gap at the end is as wide as asked.
  struct Bound {
    std::vector<int> dofs;
    std::vector<double> coefficients;
    double missing = 0;  ///< what the gap at the end of dx lacks [m]; negative where it is wider
  };
  /// Where more pairs than kMost stop the motion: whether of pairs beside each other only the first is taken, or none of
  /// all.
  bool takes_first = false;
  std::vector<std::array<int, 3>> pairs;  ///< kind, first and second primitive
  std::vector<Bound> bounds;              ///< of each pair
};

}  // namespace itr
