// SPDX-License-Identifier: MIT
#include "time/step_control.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace itr {

namespace {

constexpr double kReject = 2;       ///< of the error that is allowed
constexpr double kSafety = 0.95;    ///< of the length that would make the error just that
constexpr double kShrink = 0.2;     ///< the most at once
constexpr double kShorter = 0.4;    ///< at a jump at least
constexpr double kNear = 1e-9;      ///< of the run: stops so near are the same
constexpr int kMostJumps = 2;       ///< in a row: what is left is a jump of velocities, which no length resolves
constexpr double kJumpOrder = 0.5;  ///< of the error's order in h, by that of a smooth motion

double error_constant(const TimeOptions& time) {
  return time.integrator == Integrator::newmark                     ? 1.0 / 12
         : time.integrator == Integrator::bdf && time.bdf_order > 1 ? 2.0 / 9
                                                                    : 0.5;
}

}  // namespace

double AdaptiveTimeOptions::next_stop(double t) const {
  const double now = t + kNear * (end - begin);
  if (now >= end) return std::numeric_limits<double>::infinity();
  double stop = end;
  if (const auto kink = std::upper_bound(kinks.begin(), kinks.end(), now); kink != kinks.end()) stop = std::min(stop, *kink);
  if (output_dt > 0) stop = std::min(stop, begin + output_dt * (std::floor((now - begin) / output_dt) + 1));
  return stop;
}

bool AdaptiveTimeOptions::is_asked(double t) const {
  const double near = kNear * (end - begin);
  return output_dt <= 0 || t >= end - near || std::abs(std::remainder(t - begin, output_dt)) <= near;
}

/// A free oscillator of frequency w has the local error C (wh)^(p+1) in the energy norm, and 2 pi C (wh)^p in a period.
StepController::StepController(const TimeOptions& time) : options_(time.adaptive), has_inertia_(time.has_inertia()) {
  const double C = error_constant(time);
  order_ = C == 0.5 ? 1 : 2;
  allowed_ = has_inertia_ ? C * std::pow(options_.tolerance / (2 * std::numbers::pi * C), (order_ + 1.0) / order_)
                          : options_.tolerance;
}

std::optional<StepTrial> StepController::shorter(const StepErrors& errors, const StepTrial& trial, double dt,
                                                 int accuracy) const {
  if (dt <= options_.dt_min * (1 + kNear)) return std::nullopt;
  const double least = std::max(kShrink, options_.dt_min / dt);
  if (errors.impact > options_.tolerance && dt > errors.resolving_dt) {
    constexpr double kEarly = 0.1, kLate = 0.95;
    const bool lands = errors.way_to_contact > kEarly && errors.way_to_contact < kLate;
    return trial.shortened(std::max(lands ? errors.way_to_contact : std::min(0.5, errors.resolving_dt / dt), least));
  }
  const double error = errors.error / allowed_;
  if (!(error > kReject)) return std::nullopt;
  const double order = exponent(accuracy);
  const bool fell_less = trial.error > 0 && error > trial.error * std::pow(trial.part, kJumpOrder * order);
  if (fell_less && trial.jumps + 1 >= kMostJumps) return std::nullopt;
  const double fitting = kSafety * std::pow(error, -1 / order);
  StepTrial next = trial.shortened(std::clamp(fell_less ? std::min(fitting, kShorter) : fitting, least, kSafety));
  next.error = error;
  next.jumps = fell_less ? trial.jumps + 1 : 0;
  return next;
}

StepControl StepController::after(const StepControl& before, const StepErrors& errors, const StepTrial& trial, double dt,
                                  double energy) const {
  constexpr double kLeastGrowth = 1.15;  // less keeps the length, and with it the factor
  const double order = exponent(order_), error = errors.error / allowed_;
  const bool was_shortened = trial.length < 1;
  const auto fitting = [&](double e) { return e > 0 ? kSafety * std::pow(e, -1 / order) : kGrowth; };
  // Two errors in a row have to allow growth: a wave's passes through zero.
  double factor = std::max(fitting(std::max(error, before.error)), std::min(1.0, fitting(error)));
  factor = std::clamp(factor, kShrink, was_shortened ? 1 : kGrowth);
  if (factor > kSafety && factor < kLeastGrowth) factor = 1;
  StepControl control{.dt = dt * factor, .error = was_shortened ? 0 : error, .energy = std::max(before.energy, energy)};
  if (factor >= 1 && !was_shortened) control.dt = std::max(control.dt, before.dt);  // it was short to end at a stop
  return control;
}

StepController::Next StepController::next(const StepControl& control, double t, double first_dt, double dt_before) const {
  double dt = std::min(control.dt > 0 ? control.dt : first_dt, options_.dt_max);
  if (dt_before > 0) dt = std::min(dt, kGrowth * dt_before);
  dt = std::max(dt, options_.dt_min);
  const double stop = options_.next_stop(t), left = stop - t;
  if (dt >= left * (1 - kNear)) return {left, stop};
  if (dt > left / 2) dt = left / 2;
  return {dt, t + dt};
}

}  // namespace itr
