// SPDX-License-Identifier: MIT
// Rounds in which a step is solved again with what was lagged at the solution before: how they end, and how far they go.
#pragma once

#include <Eigen/QR>
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

/// Anderson's mixing of rounds: of the combinations of earlier rounds it takes that with the least residual, were all linear
/// (Walker & Ni 2011). Where loads exceed stiffness, plain rounds go farther and farther off.
class Mixing {
 public:
  /// The positions at which to lag in the next round, after one that was lagged at `lagged` and has led to `now`.
  VectorX next(const VectorX& lagged, const VectorX& now) {
    constexpr std::size_t kMostRounds = 10;
    constexpr double kFast = 0.5;  ///< of the residual before: rounds that come to less need no mixing
    const VectorX residual = now - lagged;
    const bool is_fast = !residuals_.empty() && residual.norm() < kFast * residuals_.back().norm();
    if (residuals_.size() == kMostRounds) {
      residuals_.erase(residuals_.begin());
      images_.erase(images_.begin());
    }
    residuals_.push_back(residual);
    images_.push_back(now);
    const auto rounds = static_cast<Eigen::Index>(residuals_.size()) - 1;
    if (rounds == 0 || is_fast) return now;
    MatrixX changes(now.size(), rounds), of_images(now.size(), rounds);
    for (Eigen::Index k = 0; k < rounds; ++k) {
      changes.col(k) = residual - residuals_[static_cast<std::size_t>(k)];
      of_images.col(k) = now - images_[static_cast<std::size_t>(k)];
    }
    return now - of_images * changes.colPivHouseholderQr().solve(residual);
  }

 private:
  std::vector<VectorX> residuals_, images_;  ///< newest last
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
