// SPDX-License-Identifier: MIT
#include "convergence.hpp"

#include <algorithm>
#include <cmath>

namespace itr {

namespace {

constexpr double kNothing = 1e-10;     ///< see NewtonExtras::way_to_start
constexpr double kVanishing = 1e-140;  ///< squares of smaller numbers are no numbers any more
constexpr double kFloor = 8;           ///< times the round-off of the gradient: no step can be told to improve it
constexpr double kFarAbove = 1e4;      ///< the same: a larger residual is an error, not round-off
constexpr int kMostUnresolved = 20;    ///< steps in a row below the resolution of the energy
constexpr int kMostStill = 4;          ///< of these, steps in a row after which the gradient had not shrunk
constexpr double kShrunk = 0.9;        ///< fraction of the gradient that had shrunk last
constexpr double kNear = 10;           ///< times a tolerance

}  // namespace

bool Convergence::has_small_gradient() {
  if (!held_.is_done()) return false;
  const NewtonOptions& options = task_.options;
  const double now = at_.gradient_norm();
  if (first_gradient_ < 0) first_gradient_ = now;
  if (now <= std::max(force_asked(), kVanishing)) return true;
  if (!is_first()) return now < options.gradient_tolerance || now < options.relative_gradient_tolerance * first_gradient_;
  if (begins_elsewhere() && now > kNothing * task_.norms.of_gradient(task_.extras.gradient_of_way)) return false;
  return now < options.first_gradient_tolerance;
}

bool Convergence::has_small_step(const Step& step) {
  const NewtonOptions& options = task_.options;
  if (first_step_ < 0) first_step_ = step.norm;
  if (!is_first()) return step.norm < options.step_tolerance || step.norm < options.relative_step_tolerance * first_step_;
  if (begins_elsewhere() && step.norm > kNothing * task_.norms.of_step(task_.extras.way_to_start)) return false;
  return step.norm < options.step_tolerance;
}

std::optional<Termination> Convergence::test(const Step& step) {
  if (!held_.is_done()) {
    unresolved_ = 0;
    return {};
  }
  if (step.is_of_shift) {
    unresolved_ = 0;
    return {};
  }
  if (has_small_step(step)) return Termination::step;
  if (at_.decrement_of(step) < task_.options.decrement_tolerance) return Termination::decrement;
  if (has_ceased_to_improve(step)) return Termination::round_off;
  return {};
}

/// The one rule for round-off: a step that promises less than the energy resolves may still lower the gradient, but not
/// below the gradient's own round-off.
bool Convergence::has_ceased_to_improve(const Step& step) {
  unresolved_ = at_.is_unresolved(step) ? unresolved_ + 1 : 0;
  if (unresolved_ == 0) {
    still_ = 0;
    return false;
  }
  const double now = at_.gradient_norm();
  still_ = unresolved_ > 1 && now > kShrunk * last_shrunk_ ? still_ + 1 : 0;
  if (still_ == 0) last_shrunk_ = now;
  return now <= kFloor * at_.gradient_round_off() || still_ >= kMostStill || unresolved_ >= kMostUnresolved;
}

bool Convergence::is_at_round_off() const { return at_.gradient_norm() <= kFarAbove * at_.gradient_round_off(); }

double Convergence::residual_by_round_off() const { return at_.gradient_norm() / at_.gradient_round_off(); }

bool Convergence::has_stalled(double value_before) {
  const bool hardly_changed = std::abs(at_.value() - value_before) < task_.options.energy_tolerance;
  stalled_ = held_.is_done() && hardly_changed ? stalled_ + 1 : 0;
  return stalled_ >= task_.options.energy_steps && task_.options.energy_tolerance > 0;
}

bool Convergence::is_near(const Step& step) const {
  const NewtonOptions& options = task_.options;
  return step.norm < kNear * options.step_tolerance || step.norm < kNear * options.relative_step_tolerance * first_step_ ||
         at_.decrement_of(step) < kNear * options.decrement_tolerance || at_.is_unresolved(step);
}

double Convergence::gradient_asked() const {
  const NewtonOptions& options = task_.options;
  return std::max({options.gradient_tolerance, options.relative_gradient_tolerance * first_gradient_, force_asked()});
}

/// The forces that act are the measure, unless the options give another one for gradients.
double Convergence::force_asked() const {
  const NewtonOptions& options = task_.options;
  const bool has_other = options.gradient_tolerance > 0 || options.relative_gradient_tolerance > 0;
  return has_other ? 0 : options.force_tolerance * at_.force_size();
}

void Convergence::note_decrement(const Step& step) {
  decrement_ = at_.decrement_of(step);
  gradient_of_decrement_ = at_.gradient_norm();
}

/// The decrement scales with the square of the gradient.
void Convergence::foresee_decrement() {
  if (!(gradient_of_decrement_ > 0)) return;
  const double ratio = at_.gradient_norm() / gradient_of_decrement_;
  decrement_ *= std::min(1.0, ratio * ratio);
}

}  // namespace itr
