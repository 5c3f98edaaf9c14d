// SPDX-License-Identifier: MIT
#pragma once

#include <limits>
#include <string>

#include "iterate.hpp"

namespace itr {

/// The motion of held dofs to their targets. In each iteration they advance as far as bodies let them, or stay so that the
/// bodies can give way; an exact penalty of the way left makes that a descent (Nocedal & Wright 2006, §18.3).
class HeldMotion {
 public:
  /// `target` is as long as x, or empty: they stay.
  HeldMotion(const Task& task, Iterate& at, const VectorX& target) : task_(task), at_(at), target_(target) {}

  /// Decides what held dofs do in the iteration that begins. Puts them at their targets if hardly any way is left.
  void plan();
  bool is_done() const { return state_ == State::done; }
  bool is_advancing() const { return state_ == State::advancing; }
  /// Motion asked of the held dofs in this iteration. Assembling the Hessian adds its effect to the Newton system.
  PrescribedMotion& motion() { return motion_; }

  /// Whether they have hardly come nearer to their targets in many iterations: something blocks their way for good.
  bool is_stuck();
  std::string describe_way_left() const;
  /// Lets the bodies relax in the next iteration.
  void wait() { waits_next_ = true; }
  /// After a step that the search did not find: whether the next iteration may find one, because held dofs then wait where
  /// they advanced, or go on where the bodies have relaxed.
  bool takes_turns(bool is_relaxed);
  bool is_blocked_for_good() const;

  /// Makes the penalty so large that the full step lowers the merit function of the quadratic model by at least half of the
  /// penalty.
  void raise_penalty(const Step& step, double slope);
  double merit_slope(double slope) const { return is_advancing() ? slope - penalty_ * way_left_ : slope; }
  double merit_change(double change, double share) const {
    return change - (is_advancing() ? penalty_ * share * way_left_ : 0);
  }
  void note_share(double share);
  /// Exactly there, not to round-off.
  void move_to_targets(VectorView x) const;

 private:
  struct Kept {
    KeptVector place;
  };
  enum class State { done, advancing, waiting };
  bool finish(const VectorX& remaining);

  const Task& task_;
  Iterate& at_;
  const VectorX& target_;
  State state_ = State::done;
  bool waits_next_ = false;
  PrescribedMotion motion_;
  double way_left_ = 0;                                               ///< sum over dofs
  double whole_way_ = 0;                                              ///< the same at the start
  double way_left_before_ = std::numeric_limits<double>::infinity();  ///< when is_stuck looked last
  double penalty_ = 0;
  int blocked_ = 0;  ///< iterations in a row that brought them no nearer
};

}  // namespace itr
