// SPDX-License-Identifier: MIT
#include "search.hpp"

#include <cmath>

#include "blocked_step.hpp"
#include "core/timer.hpp"

namespace itr {

namespace {

constexpr double kArmijo = 1e-4;
constexpr double kResolved = 8;  ///< times its round-off: changes of energy below which slopes tell more
constexpr double kLeastShare = 1e-14;
constexpr double kStraightFall = 0.8;  ///< of the slope: an energy that falls by more over a full step hardly curves
constexpr int kMostHalvings = 40, kMostDoublings = 12;
constexpr double kSingleWaysBelow = 0.25, kMuchMore = 2;  ///< see try_single_ways
constexpr double kBlockedBelow = 0.5;                     ///< share of a step below which what is in the way is looked at
constexpr int kLong = 20;                                 ///< iterations from which on what blocks steps is kept
constexpr double kWaitBelow = 0.1;  ///< a step blocked to less than this lets the bodies relax before held dofs go on

}  // namespace

Search::Search(const Task& task, Iterate& at, HeldMotion& held)
    : task_(task),
      at_(at),
      held_(held),
      kept_(task.workspace.get<Kept>()),
      candidate_(kept_.candidate.resize(at.x().size())),
      other_(kept_.other.resize(at.x().size())) {}

bool Search::along(Step& step) {
  const bool advancing = held_.is_advancing();
  const Way way = look_ahead(step);
  if (advancing && way.share < kWaitBelow) held_.wait();
  if (way.share < kBlockedBelow) note_blocked(step);
  held_.raise_penalty(step, way.slope);
  double share = way.share;
  for (int i = 0; i < kMostHalvings && share > kLeastShare; ++i, share /= 2) {
    candidate_ = at_.x() + share * step.way;
    if (advancing && share == 1) held_.move_to_targets(candidate_);
    double value = at_.value_at(candidate_);
    if (!std::isfinite(value) || !is_acceptable(value, share, way, step)) continue;
    const bool straight = falls_straight(value, share, way, step);
    held_.note_share(share);
    if (way.has_single_ways) try_single_ways(value);
    at_.move_to(candidate_, value);
    if (straight) go_on(step.way);
    return true;
  }
  return false;
}

Search::Way Search::look_ahead(Step& step) {
  // Not in patches, which end after a few iterations in any case, and not with PolyFEM's way, which is kept as it is.
  const bool is_own_way = task_.options.indefinite == IndefiniteHessian::project;
  const bool may_turn = !task_.extras.is_brief && is_own_way;
  const bool advancing = held_.is_advancing();
  double share = at_.free_share(step.way);
  bool has_single_ways = false;
  {
    const ScopedTimer timer(task_.summary.ccd_seconds);
    if (share < kBlockedBelow && !advancing && may_turn)
      share = turn_blocked_step({task_.energy, at_.x(), task_.dofs, at_.gradient(), task_.system, task_.workspace}, step.way,
                                share);
    if (share < kSingleWaysBelow && !advancing && is_own_way)
      has_single_ways = task_.energy.get_single_ways(at_.x(), step.way, kept_.ways.resize(at_.x().size()), task_.workspace);
  }
  return {share, at_.gradient().dot(step.way), has_single_ways};
}

void Search::note_blocked(const Step& step) {
  NewtonSummary& summary = task_.summary;
  if (summary.iterations == last_blocked_) return;  // a step of this iteration was, before it was given up
  last_blocked_ = summary.iterations;
  ++summary.blocked;
  if (task_.extras.is_brief || summary.iterations < kLong) return;
  summary.blocked_from = at_.x();
  summary.blocked_step = step.way;
}

bool Search::is_acceptable(double value, double share, const Way& way, const Step& step) {
  const bool advancing = held_.is_advancing();
  const double change = held_.merit_change(value - at_.value(), share), slope = held_.merit_slope(way.slope);
  if (change <= kArmijo * share * slope) return true;
  if (advancing) return false;
  // PolyFEM's "RobustArmijo" (docs/theory.md, "Tolerances"; Hager & Zhang): if the energy changes little, in either
  // direction, a slope that still falls at the end suffices. This rule refuses full steps to the minimum of a quadratic.
  // So, where the energy changes by round-off alone, a slope that shrinks to half suffices, too: if the end is no higher, or
  // the promised decrease was below round-off.
  const double change_of_energy = std::abs(value - at_.value());
  if (change_of_energy > 0.1 * std::abs(at_.value()) && change_of_energy > kResolved * at_.value_round_off()) return false;
  const double after = slope_at_candidate(step);
  const double resolved = kResolved * at_.value_round_off();
  return after <= kArmijo * slope ||
         (change_of_energy <= resolved && (value <= at_.value() || -share * slope <= resolved) && after <= -0.5 * slope);
}

/// Whether the energy hardly curves over the full step. The slope at the end has to confirm it: values alone are unreliable
/// near round-off.
bool Search::falls_straight(double value, double share, const Way& way, const Step& step) {
  return !held_.is_advancing() && share == 1 && value - at_.value() < kStraightFall * way.slope &&
         slope_at_candidate(step) < kStraightFall / 2 * way.slope;
}

double Search::slope_at_candidate(const Step& step) {
  at_.gradient_at(candidate_, other_);
  return task_.norms.dot(step.way, other_);
}

/// Moves each vertex as far as it can go alone, if the energy falls by much more there. Not if cells invert on the way: this
/// leads to squeezed cells, which take more iterations than it saves.
void Search::try_single_ways(double& value) {
  const VectorView ways = kept_.ways.view();
  if (at_.free_share(ways) < 1) return;
  other_ = at_.x() + ways;
  const double there = at_.value_at(other_);
  if (!(there - at_.value() < kMuchMore * (value - at_.value()))) return;
  candidate_ = other_;
  value = there;
}

void Search::go_on(ConstVectorView way) {
  other_ = way;
  for (int k = 0; k < kMostDoublings; ++k) {
    other_ *= 2;
    if (at_.free_share(other_) < 1) return;
    candidate_ = at_.x() + other_;
    const double value = at_.value_at(candidate_);
    if (!(value < at_.value())) return;
    at_.move_to(candidate_, value);
  }
}

}  // namespace itr
