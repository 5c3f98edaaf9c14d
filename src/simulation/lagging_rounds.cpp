// SPDX-License-Identifier: MIT
#include "lagging_rounds.hpp"

#include <algorithm>

namespace itr {

namespace {

constexpr double kFixedPoint = 1e-12;  ///< of the bodies' diagonal: rounds of lagging that move nothing more are over
constexpr double kSameState = 1e-3;    ///< of a solve's step tolerance: states nearer than that are one

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
