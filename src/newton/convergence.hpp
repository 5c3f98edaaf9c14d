// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>

#include "dirichlet_continuation.hpp"

namespace itr {

/// The tests by which a solve ends. None holds before held dofs are at their targets.
class Convergence {
 public:
  Convergence(const Task& task, const Iterate& at, const DirichletContinuation& held) : task_(task), at_(at), held_(held) {}

  bool has_small_gradient() {
    if (!held_.is_done()) return false;
    const NewtonOptions& options = task_.options;
    const double now = at_.gradient_norm();
    if (first_gradient_ < 0) first_gradient_ = now;
    if (now <= std::max(force_asked(), kVanishing)) return !turns_aside(now);
    if (!is_first()) return now < options.gradient_tolerance || now < options.relative_gradient_tolerance * first_gradient_;
    if (begins_elsewhere() && now > kNothing * task_.norms.of_gradient(task_.extras.gradient_of_step)) return false;
    return now < options.first_gradient_tolerance;
  }
  /// Which test a full step passes, if one: its length, its decrement, or that nothing is left to improve.
  std::optional<Termination> test(const Step& step) {
    if (!held_.is_done()) {
      unresolved_ = creeping_ = 0;
      return {};
    }
    if (step.is_of_shift) {
      creeping_ = 0;
      return {};
    }
    if (has_small_step(step)) return Termination::step;
    if (at_.decrement_of(step) < task_.options.decrement_tolerance) return Termination::decrement;
    if (has_ceased_to_improve(step) || creeps(step)) return Termination::round_off;
    return {};
  }
  /// Whether the forces that are left are their own round-off: what a solve that finds no better state may end with.
  bool is_at_round_off() const { return at_.gradient_norm() <= kFarAbove * at_.gradient_round_off(); }
  /// The norm of the gradient by that of its round-off, for a solve that ends without.
  double residual_by_round_off() const { return at_.gradient_norm() / at_.gradient_round_off(); }
  /// Whether the solve ended since its steps were inexact.
  bool is_creeping() const { return creeping_ >= kMostCreeping; }
  /// Counts the iterations in a row that hardly changed the energy.
  bool has_stalled(double value_before) {
    const bool hardly_changed = std::abs(at_.value() - value_before) < task_.options.energy_tolerance;
    stalled_ = held_.is_done() && hardly_changed ? stalled_ + 1 : 0;
    return stalled_ >= task_.options.energy_steps && task_.options.energy_tolerance > 0;
  }

  /// Whether a loosely solved step may be the last one of the solve.
  bool is_near(const Step& step) const {
    const NewtonOptions& options = task_.options;
    return step.norm < kNear * options.step_tolerance || step.norm < kNear * options.relative_step_tolerance * first_step_ ||
           at_.decrement_of(step) < kNear * options.decrement_tolerance || at_.is_unresolved(step);
  }
  double gradient_asked() const {
    const NewtonOptions& options = task_.options;
    return std::max({options.gradient_tolerance, options.relative_gradient_tolerance * first_gradient_, force_asked()});
  }

  /// Energy that the last full step promises, or the gradient where no step was computed any more.
  double decrement() const { return decrement_; }
  void note_decrement(const Step& step) {
    decrement_ = at_.decrement_of(step);
    gradient_of_decrement_ = at_.gradient_norm();
  }
  /// The decrement scales with the square of the gradient.
  void predict_decrement() {
    if (!(gradient_of_decrement_ > 0)) return;
    const double ratio = at_.gradient_norm() / gradient_of_decrement_;
    decrement_ *= std::min(1.0, ratio * ratio);
  }

 private:
  static constexpr double kNothing = 1e-10;       ///< see NewtonExtras::step_to_start
  static constexpr double kAside = 1e-5;          ///< see NewtonExtras::add_inertia_of_motion
  static constexpr double kVanishing = 1e-140;    ///< squares of smaller numbers are no numbers any more
  static constexpr double kFloor = 8;             ///< times the round-off of the gradient: no step can be told to improve it
  static constexpr double kFarAbove = 1e4;        ///< the same: a larger residual is an error, not round-off
  static constexpr int kMostUnresolved = 20;      ///< steps in a row below the resolution of the energy
  static constexpr int kMostStill = 4;            ///< of these, steps in a row after which the gradient had not shrunk
  static constexpr double kHardlyResolved = 100;  ///< times the round-off of the energy
  static constexpr int kMostCreeping = 50;        ///< steps in a row that promise less
  static constexpr double kShrunk = 0.9;          ///< fraction of the gradient that had shrunk last
  static constexpr double kNear = 10;             ///< times a tolerance

  /// The forces that act are the measure, unless the options give another one for gradients.
  double force_asked() const {
    const NewtonOptions& options = task_.options;
    const bool has_other = options.gradient_tolerance > 0 || options.relative_gradient_tolerance > 0;
    return has_other ? 0 : options.force_tolerance * at_.force_size();
  }
  bool is_first() const { return task_.summary.iterations == 0; }
  bool begins_elsewhere() const { return task_.extras.step_to_start.size() > 0; }
  /// Whether inertia feels the forces that are left, small as they are; a solve goes on for this once.
  bool turns_aside(double residual) {
    if (!task_.extras.add_inertia_of_motion || residual <= kVanishing) return false;
    if (turns_aside_at_ != kNone) return turns_aside_at_ == at_.revision();
    VectorX inertia = VectorX::Zero(at_.x().size());
    task_.extras.add_inertia_of_motion(at_.x(), inertia);
    const double felt = task_.norms.of_gradient(inertia);
    if (residual <= kAside * felt || !(felt > 0)) return false;
    turns_aside_at_ = at_.revision();
    return true;
  }
  bool has_small_step(const Step& step) {
    const NewtonOptions& options = task_.options;
    if (first_step_ < 0) first_step_ = step.norm;
    if (!is_first()) return step.norm < options.step_tolerance || step.norm < options.relative_step_tolerance * first_step_;
    if (begins_elsewhere() && step.norm > kNothing * task_.norms.of_step(task_.extras.step_to_start)) return false;
    return step.norm < options.step_tolerance;
  }
  /// The one rule for round-off: a step that promises less than the energy resolves, or moves less than positions resolve,
  /// may still lower the gradient. Such steps end the solve where the gradient is its own round-off, unless the first one
  /// moves more than positions' round-off, or where it does not shrink any more.
  bool has_ceased_to_improve(const Step& step) {
    const std::optional<double> seen = task_.extras.position_round_off;
    const bool is_hidden = seen && step.direction.cwiseAbs().maxCoeff() <= kFloor * *seen;
    const bool is_below_energy = at_.is_unresolved(step);
    unresolved_ = is_below_energy || is_hidden ? unresolved_ + 1 : 0;
    if (unresolved_ == 0) {
      still_ = 0;
      return false;
    }
    const double now = at_.gradient_norm();
    still_ = unresolved_ > 1 && now > kShrunk * last_shrunk_ ? still_ + 1 : 0;
    if (still_ == 0) last_shrunk_ = now;
    const bool is_worth_a_try = !is_below_energy || turns_aside_at_ == at_.revision() || (is_first() && seen && !is_hidden);
    return (!is_worth_a_try && now <= kFloor * at_.gradient_round_off()) || still_ >= kMostStill ||
           unresolved_ >= kMostUnresolved;
  }

  /// Steps by solves that a system near a singular one leaves inexact may promise a little more than the energy resolves
  /// again and again.
  bool creeps(const Step& step) {
    creeping_ = at_.is_unresolved(step, kHardlyResolved) ? creeping_ + 1 : 0;
    return is_creeping() && is_at_round_off();
  }

  const Task& task_;
  const Iterate& at_;
  const DirichletContinuation& held_;
  double first_gradient_ = -1, first_step_ = -1;  ///< norms with the held dofs in place; below 0: not there yet
  double decrement_ = 0, gradient_of_decrement_ = 0;
  int unresolved_ = 0;      ///< steps in a row that promised less than the energy resolves, or that positions hide
  double last_shrunk_ = 0;  ///< gradient norm of the last of these where it was less than before
  int still_ = 0;           ///< of these, those since
  int creeping_ = 0;        ///< steps in a row that promised hardly more than the energy resolves
  int stalled_ = 0;
  int turns_aside_at_ = kNone;  ///< the revision of x at which the solve has gone on for it
};

}  // namespace itr
