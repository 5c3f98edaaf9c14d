// SPDX-License-Identifier: MIT
// Counts of a remesher.
#pragma once

namespace itr {

struct OperationCount {
  int tried = 0, accepted = 0;
  int relaxed = 0;  ///< tried operations that a relaxed patch decided; bounds decided the others
  OperationCount& operator+=(const OperationCount& other) {
    tried += other.tried;
    accepted += other.accepted;
    relaxed += other.relaxed;
    return *this;
  }
};

struct RemeshReport {
  OperationCount splits, curves, collapses, swaps, smooths;
  double trial_seconds = 0;              ///< median over the trials; 0 where there were none
  double best_refused_gain = 0;          ///< most that a split or a curve which was refused would have gained [J s^2]
  int bound_by_activation_distance = 0;  ///< surface edges not split because they are shorter than 2 dhat

  int accepted() const { return splits.accepted + curves.accepted + collapses.accepted + swaps.accepted + smooths.accepted; }
  bool changed() const { return accepted() > 0; }
  /// Whether the new space lacks functions of the old one, so that the history has to be projected.
  bool coarsened() const { return collapses.accepted + swaps.accepted + smooths.accepted > 0; }
};

}  // namespace itr
