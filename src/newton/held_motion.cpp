// SPDX-License-Identifier: MIT
#include "held_motion.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

namespace itr {

namespace {

constexpr int kMaxBlocked = 50;
constexpr double kLeastProgress = 0.99;  ///< in so many iterations: the share of the way that is left at most
constexpr double kNoWay = 1e-6;          ///< share of a step that brings held dofs no nearer
constexpr double kLeastPenalty = 1e-8;   ///< force by length and stiffness: above the round-off of a body at rest

}  // namespace

void HeldMotion::plan() {
  state_ = State::done;
  const bool waits = std::exchange(waits_next_, false);
  motion_.step.resize(0);
  if (target_.size() == 0) return;
  const VectorView& x = at_.x();
  VectorX remaining = VectorX::Zero(x.size());
  for (Eigen::Index i = 0; i < x.size(); ++i)
    if (task_.dofs.unknown[i] == kNone) remaining[i] = target_[i] - x[i];
  way_left_ = remaining.lpNorm<1>();
  if (!(whole_way_ > 0)) whole_way_ = way_left_;
  if (!(way_left_ > 0)) return;
  if (remaining.norm() < task_.options.step_tolerance && finish(remaining)) return;
  state_ = waits ? State::waiting : State::advancing;
  if (is_advancing()) motion_.step = std::move(remaining);
}

/// Puts held dofs at their targets if the way is free. No line search is made: the rest of the way is within the tolerance
/// of positions, and may change the energy by less than its round-off.
bool HeldMotion::finish(const VectorX& remaining) {
  if (at_.free_share(remaining) < 1) return false;
  VectorView place = task_.workspace.get<Kept>().place.resize(remaining.size());
  place = at_.x();
  move_to_targets(place);
  const double value = at_.value_at(place);
  if (!std::isfinite(value)) return false;
  at_.move_to(place, value);
  return true;
}

void HeldMotion::move_to_targets(VectorView x) const {
  for (Eigen::Index i = 0; i < x.size(); ++i)
    if (task_.dofs.unknown[i] == kNone) x[i] = target_[i];
}

bool HeldMotion::is_stuck() {
  if (is_done() || task_.summary.iterations % kMaxBlocked != 0) return false;
  return way_left_ > kLeastProgress * std::exchange(way_left_before_, way_left_);
}

std::string HeldMotion::describe_way_left() const {
  std::ostringstream text;
  text << "held vertices cannot reach their targets, " << 100 * way_left_ / whole_way_ << " % of their way is left";
  return text.str();
}

bool HeldMotion::takes_turns(bool is_relaxed) {
  if (is_done() || (state_ == State::waiting && !is_relaxed)) return false;
  waits_next_ = is_advancing();
  ++blocked_;
  return true;
}

bool HeldMotion::is_blocked_for_good() const { return blocked_ > kMaxBlocked; }

void HeldMotion::raise_penalty(const Step& step, double slope) {
  if (!is_advancing()) return;
  penalty_ = std::max({penalty_, kLeastPenalty * task_.system.diagonal_scale() * way_left_,
                       2 * std::max(0.0, slope + 0.5 * std::max(0.0, step.curvature)) / way_left_});
}

void HeldMotion::note_share(double share) {
  if (is_advancing()) blocked_ = share < kNoWay ? blocked_ + 1 : 0;
}

}  // namespace itr
