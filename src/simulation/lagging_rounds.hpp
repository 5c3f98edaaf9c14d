// SPDX-License-Identifier: MIT
// Rounds in which a step is solved again with what was lagged at the solution before: how they end, and how far they go.
#pragma once

#include <algorithm>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "itr/types.hpp"

namespace itr {

/// How rounds of lagging end.
enum class RoundsEnd {
  settled,  ///< another round changes nothing, to the solver's tolerances
  asked,    ///< as many as the scene asks for, or forces to its tolerance
  most,     ///< as many as there may be
  cycle,    ///< an earlier round has been reached again
  stalled   ///< forces have not come nearer for long
};

/// Says how rounds ended that did not settle.
inline std::string_view to_string(RoundsEnd end) {
  return end == RoundsEnd::most ? "out of rounds" : end == RoundsEnd::cycle ? "in a cycle" : "not coming nearer";
}

/// Aitken's factor for the relaxation of rounds: how far to go along what a round would change (Küttler & Wall 2008).
class Relaxation {
 public:
  /// The factor after a round that leaves lagged forces off by `residual` [N].
  double factor(VectorX residual) {
    constexpr double kLeast = 0.25, kLargest = 4;
    constexpr double kFast = 0.5;  ///< of the residual before: rounds that come to less need no relaxation
    if (last_.size() > 0) {
      const VectorX change = residual - last_;
      const double squared = change.squaredNorm();
      const double aitken = squared > 0 ? -factor_ * last_.dot(change) / squared : 1;
      const bool is_fast = residual.norm() < kFast * last_.norm();
      factor_ = is_fast || aitken <= 0 ? 1 : std::clamp(aitken, kLeast, kLargest);
    }
    last_ = std::move(residual);
    return factor_;
  }

 private:
  VectorX last_;  ///< residual
  double factor_ = 1;
};

/// Whether rounds that reached x, after `previous` (newest last), are over. Lagging need not converge: it can go round in
/// circles, and then every further round repeats an earlier one. `diagonal`: of the bodies [m].
inline std::optional<RoundsEnd> has_recurred(const VectorX& x, const std::vector<VectorX>& previous, double step_tolerance,
                                             double diagonal) {
  constexpr double kFixedPoint = 1e-12;  ///< of the bodies' diagonal: rounds of lagging that move nothing more are over
  constexpr double kSameState = 1e-3;    ///< of a solve's step tolerance: states nearer than that are one
  const double last = (x - previous.back()).lpNorm<Eigen::Infinity>();
  if (last <= kFixedPoint * diagonal) return RoundsEnd::settled;
  const bool has_met = std::any_of(previous.begin(), previous.end() - 1,
                                   [&](const VectorX& y) { return (x - y).norm() <= kSameState * step_tolerance; });
  if (!has_met) return std::nullopt;
  return (x - previous.back()).norm() <= step_tolerance ? RoundsEnd::settled : RoundsEnd::cycle;
}

}  // namespace itr
