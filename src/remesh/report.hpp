// SPDX-License-Identifier: MIT
// Counts of a remesher.
#pragma once

#include "itr/frame.hpp"

namespace itr {

struct RemeshReport {
  OperationCount splits, curves, straightens, collapses, swaps, smooths;
  double trial_seconds = 0;      ///< median over the trials; 0 where there were none
  double best_refused_gain = 0;  ///< most that a refused split would have gained, as it was predicted or found [J s^2]

  int accepted() const { return splits.accepted + curves.accepted + coarsenings(); }
  bool changed() const { return accepted() > 0; }
  /// Whether the new space lacks functions of the old one, so that the history has to be projected.
  bool coarsened() const { return coarsenings() > 0; }
  int coarsenings() const { return straightens.accepted + collapses.accepted + swaps.accepted + smooths.accepted; }
};

}  // namespace itr
