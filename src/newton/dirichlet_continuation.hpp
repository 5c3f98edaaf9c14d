// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <string>
#include <utility>

#include "iterate.hpp"

namespace itr {

/// The motion of held dofs to their targets. In each iteration they advance as far as bodies let them, or stay so that the
/// bodies can give way; an exact penalty of the way left makes that a descent (Nocedal & Wright 2006, §18.3).
class DirichletContinuation {
 public:
  /// `target` is as long as x, or empty: they stay.
  DirichletContinuation(const Task& task, Iterate& at, const VectorX& target) : task_(task), at_(at), target_(target) {}

  /// Decides what held dofs do in the iteration that begins. Puts them at their targets if hardly any way is left.
  void plan() {
    state_ = State::done;
    const bool waits = std::exchange(waits_next_, false);
    motion_.step.resize(0);
    if (target_.size() == 0) return;
    const VectorView& x = at_.x();
    VectorX remaining = VectorX::Zero(x.size());
    for (Eigen::Index i = 0; i < x.size(); ++i)
      if (task_.dofs.unknown[i] == kNone) remaining[i] = target_[i] - x[i];
    distance_left_ = remaining.lpNorm<1>();
    if (!(whole_distance_ > 0)) whole_distance_ = distance_left_;
    if (!(distance_left_ > 0)) return;
    if (remaining.norm() < task_.options.step_tolerance && finish(remaining)) return;
    state_ = waits ? State::waiting : State::advancing;
    if (is_advancing()) motion_.step = std::move(remaining);
  }
  bool is_done() const { return state_ == State::done; }
  bool is_advancing() const { return state_ == State::advancing; }
  /// Motion asked of the held dofs in this iteration. Assembling the Hessian adds its effect to the Newton system.
  PrescribedMotion& motion() { return motion_; }

  /// Whether they have hardly come nearer to their targets in many iterations: something blocks their way for good.
  bool is_stuck() {
    if (is_done() || task_.summary.iterations % kMaxBlocked != 0) return false;
    return distance_left_ > kLeastProgress * std::exchange(distance_left_before_, distance_left_);
  }
  std::string describe_distance_left() const {
    std::ostringstream text;
    text << "held vertices cannot reach their targets, " << 100 * distance_left_ / whole_distance_
         << " % of their way is left";
    return text.str();
  }
  /// Lets the bodies relax in the next iteration.
  void wait() { waits_next_ = true; }
  /// After a step that the search did not find: whether the next iteration may find one, because held dofs then wait where
  /// they advanced, or go on where the bodies have relaxed.
  bool takes_turns(bool is_relaxed) {
    if (is_done() || (state_ == State::waiting && !is_relaxed)) return false;
    waits_next_ = is_advancing();
    ++blocked_;
    return true;
  }
  bool is_blocked_for_good() const { return blocked_ > kMaxBlocked; }

  /// Makes the penalty so large that the full step lowers the merit function of the quadratic model by at least half of the
  /// penalty.
  void raise_penalty(const Step& step, double slope) {
    if (!is_advancing()) return;
    penalty_ = std::max({penalty_, kLeastPenalty * task_.system.diagonal_scale() * distance_left_,
                         2 * std::max(0.0, slope + 0.5 * std::max(0.0, step.curvature)) / distance_left_});
  }
  double merit_slope(double slope) const { return is_advancing() ? slope - penalty_ * distance_left_ : slope; }
  double merit_change(double change, double fraction) const {
    return change - (is_advancing() ? penalty_ * fraction * distance_left_ : 0);
  }
  void note_fraction(double fraction) {
    if (is_advancing()) blocked_ = fraction < kNoProgress ? blocked_ + 1 : 0;
  }
  /// Exactly there, not to round-off.
  void move_to_targets(VectorView x) const {
    for (Eigen::Index i = 0; i < x.size(); ++i)
      if (task_.dofs.unknown[i] == kNone) x[i] = target_[i];
  }

 private:
  static constexpr int kMaxBlocked = 50;
  static constexpr double kLeastProgress = 0.99;  ///< in so many iterations: the fraction of the way that is left at most
  static constexpr double kNoProgress = 1e-6;     ///< fraction of a step that brings held dofs no nearer
  static constexpr double kLeastPenalty = 1e-8;   ///< force by length and stiffness: above the round-off of a body at rest

  struct Scratch {
    ScratchVector place;
  };
  enum class State { done, advancing, waiting };
  /// Puts held dofs at their targets if the way is free. No line search is made: the rest of the way is within the tolerance
  /// of positions, and may change the energy by less than its round-off.
  bool finish(const VectorX& remaining) {
    if (at_.free_fraction(remaining) < 1) return false;
    VectorView place = task_.workspace.get<Scratch>().place.resize(remaining.size());
    place = at_.x();
    move_to_targets(place);
    const double value = at_.value_at(place);
    if (!std::isfinite(value)) return false;
    at_.move_to(place, value);
    return true;
  }

  const Task& task_;
  Iterate& at_;
  const VectorX& target_;
  State state_ = State::done;
  bool waits_next_ = false;
  PrescribedMotion motion_;
  double distance_left_ = 0;                                               ///< sum over dofs
  double whole_distance_ = 0;                                              ///< the same at the start
  double distance_left_before_ = std::numeric_limits<double>::infinity();  ///< when is_stuck looked last
  double penalty_ = 0;
  int blocked_ = 0;  ///< iterations in a row that brought them no nearer
};

}  // namespace itr
