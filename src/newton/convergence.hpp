// SPDX-License-Identifier: MIT
#pragma once

#include <optional>

#include "held_motion.hpp"

namespace itr {

/// The tests by which a solve ends. None holds before held dofs are at their targets.
class Convergence {
 public:
  Convergence(const Task& task, const Iterate& at, const HeldMotion& held) : task_(task), at_(at), held_(held) {}

  bool has_small_gradient();
  /// Which test a full step passes, if one: its length, its decrement, or that nothing is left to improve.
  std::optional<Termination> test(const Step& step);
  /// Whether the forces that are left are their own round-off: what a solve that finds no better state may end with.
  bool is_at_round_off() const;
  /// The norm of the gradient by that of its round-off, for a solve that ends without.
  double residual_by_round_off() const;
  /// Counts the iterations in a row that hardly changed the energy.
  bool has_stalled(double value_before);

  /// Whether a loosely solved step may be the last one of the solve.
  bool is_near(const Step& step) const;
  double gradient_asked() const;

  /// Energy that the last full step promises, or the gradient where no step was computed any more.
  double decrement() const { return decrement_; }
  void note_decrement(const Step& step);
  void foresee_decrement();

 private:
  double force_asked() const;
  bool is_first() const { return task_.summary.iterations == 0; }
  bool begins_elsewhere() const { return task_.extras.way_to_start.size() > 0; }
  bool has_small_step(const Step& step);
  bool has_ceased_to_improve(const Step& step);

  const Task& task_;
  const Iterate& at_;
  const HeldMotion& held_;
  double first_gradient_ = -1, first_step_ = -1;  ///< norms with the held dofs in place; below 0: not there yet
  double decrement_ = 0, gradient_of_decrement_ = 0;
  int unresolved_ = 0;      ///< steps in a row that promised less than the energy resolves
  double last_shrunk_ = 0;  ///< gradient norm of the last of these where it was less than before
  int still_ = 0;           ///< of these, those since
  int stalled_ = 0;
};

}  // namespace itr
