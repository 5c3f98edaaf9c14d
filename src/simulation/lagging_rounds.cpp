// SPDX-License-Identifier: MIT
#include "lagging_rounds.hpp"

#include <algorithm>
#include <utility>

namespace itr {

namespace {

constexpr double kFixedPoint = 1e-12;  ///< of the bodies' diagonal: rounds of lagging that move nothing more are over
constexpr double kLeastFactor = 0.25, kLargestFactor = 4;
constexpr double kFast = 0.5;        ///< of the residual before: rounds that come to less need no relaxation
constexpr double kSameState = 1e-3;  ///< of a solve's step tolerance: states nearer than that are one

}  // namespace

const char* to_string(RoundsEnd end) {
  switch (end) {
    case RoundsEnd::most:
      return "out of rounds";
    case RoundsEnd::cycle:
      return "in a cycle";
    case RoundsEnd::stalled:
      return "not coming nearer";
    default:
      return "";
  }
}

double Relaxation::factor(VectorX residual) {
  if (last_.size() > 0) {
    const VectorX change = residual - last_;
    const double squared = change.squaredNorm();
    const double aitken = squared > 0 ? -factor_ * last_.dot(change) / squared : 1;
    const bool is_fast = residual.norm() < kFast * last_.norm();
    factor_ = is_fast || aitken <= 0 ? 1 : std::clamp(aitken, kLeastFactor, kLargestFactor);
  }
  last_ = std::move(residual);
  return factor_;
}

std::optional<RoundsEnd> has_recurred(const VectorX& x, const std::vector<VectorX>& previous, double step_tolerance,
                                      double diagonal) {
  const double last = (x - previous.back()).lpNorm<Eigen::Infinity>();
  if (last <= kFixedPoint * diagonal) return RoundsEnd::settled;
  const bool has_met = std::any_of(previous.begin(), previous.end() - 1,
                                   [&](const VectorX& y) { return (x - y).norm() <= kSameState * step_tolerance; });
  if (!has_met) return std::nullopt;
  return (x - previous.back()).norm() <= step_tolerance ? RoundsEnd::settled : RoundsEnd::cycle;
}

}  // namespace itr
