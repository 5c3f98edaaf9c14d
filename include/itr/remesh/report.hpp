// SPDX-License-Identifier: MIT
// Counts of a remesher.
#pragma once

#include <array>

#include "itr/remesh/refusal.hpp"

namespace itr {

struct OperationCount {
  int tried = 0, accepted = 0;
  int relaxed = 0;                       ///< tried operations that a relaxed patch decided; bounds decided the others
  std::array<int, kRefusals> refused{};  ///< by Refusal; more than were tried, as most are refused without a trial
  /// Counts a refusal, unless nobody asked or the candidate is gone.
  void note(Refusal reason) {
    if (reason != Refusal::none && reason != Refusal::not_asked && reason != Refusal::gone)
      ++refused[static_cast<int>(reason)];
  }
  int refused_by(Refusal reason) const { return refused[static_cast<int>(reason)]; }
  OperationCount& operator+=(const OperationCount& other) {
    tried += other.tried;
    accepted += other.accepted;
    relaxed += other.relaxed;
    for (int i = 0; i < kRefusals; ++i) refused[i] += other.refused[i];
    return *this;
  }
};

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
