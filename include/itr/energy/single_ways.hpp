// SPDX-License-Identifier: MIT
#pragma once

#include "itr/core/types.hpp"

namespace itr {

/// How far single vertices can go where a step as a whole is cut short. Contact leaves it in the workspace where its
/// max_step is less than `kWorthIt`; who wants to know clears it before asking.
struct SingleWays {
  static constexpr double kWorthIt = 0.25;
  /// The motion that max_step was asked about, each vertex' way as long as it is free of contact, whatever stops others;
  /// empty: not known.
  VectorX dx;
  double step = 1;  ///< what max_step returned
};

}  // namespace itr
