// SPDX-License-Identifier: MIT
#pragma once

namespace itr {

/// Stiffness-proportional Rayleigh damping: forces -coefficient * K v, with K the stiffness of one term.
struct DampingOptions {
  enum class Term { elastic, contact };
  Term term = Term::elastic;
  double coefficient = 0;  ///< [s]
  int lagging_rounds = 1;  ///< most solves of a step, each with K of the solution before it
};

}  // namespace itr
