// SPDX-License-Identifier: MIT
// Lengths of adaptive steps: what is too long, what is tried next, and where steps end (docs/theory.md, "Adaptive time").
#pragma once

#include <optional>

#include "itr/options.hpp"

namespace itr {

/// Memory of the choice of lengths from one step to the next.
struct StepControl {
  double dt = 0;      ///< proposed for the next step [s]; 0: before the first
  double error = 0;   ///< of the last step by what was allowed; 0: not known
  double energy = 0;  ///< the largest kinetic and stored energy at the end of a step so far [J]
};

/// Errors of a step that is solved.
struct StepErrors {
  double error = 0;           ///< its local error, in the energy norm, by that of the largest energy so far; 0: not known
  double impact = 0;          ///< kinetic energy that nodes lost as they came into contact, by the largest energy so far
  double resolving_dt = 0;    ///< which resolves how contact stops these nodes [s]
  double way_to_contact = 1;  ///< the part of the step after which the first of them would touch
};

/// How often a step was shortened, and why.
struct StepTrial {
  double length = 1;  ///< by that of the first trial
  double part = 1;    ///< by that of the trial before
  double error = 0;   ///< of the trial before, by what was allowed; 0: it was not shortened for its error
  int jumps = 0;      ///< trials in a row whose error fell by far less than that of a smooth motion
  bool operator==(const StepTrial&) const = default;

  /// The next trial, of a part of this one's length.
  StepTrial shortened(double by) const { return {.length = length * by, .part = by}; }
};

/// Judges steps and chooses the length of the next. Without mesh and solver.
class StepController {
 public:
  /// `options` must outlive this.
  explicit StepController(const TimeOptions& options);
  explicit StepController(TimeOptions&&) = delete;

  /// The largest StepErrors::error: such steps add about the tolerance to a free oscillator in one of its periods.
  double allowed() const { return allowed_; }
  /// The trial that replaces one with these errors, of order `accuracy`; nothing where it stands.
  std::optional<StepTrial> shorter(const StepErrors& errors, const StepTrial& trial, double dt, int accuracy) const;
  /// The memory after a step of length dt that stands. `energy` is that at its end [J].
  StepControl after(const StepControl& before, const StepErrors& errors, const StepTrial& trial, double dt,
                    double energy) const;
  /// The length of the step from t on [s], and where it ends: at a stop, or so that the next one ends there. `dt_before`
  /// is the length of the step before where the formula depends on it, else 0.
  struct Next {
    double dt = 0, end = 0;
  };
  Next next(const StepControl& control, double t, double first_dt, double dt_before) const;

  /// Steps of BDF2 grow at most by this: it is stable in zero up to 1 + sqrt(2), and a free oscillator gains no energy.
  static constexpr double kGrowth = 2;

 private:
  double exponent(int accuracy) const { return has_inertia_ ? accuracy + 1 : 2; }

  const AdaptiveTimeOptions& options_;
  bool has_inertia_;
  int order_;
  double allowed_;
};

}  // namespace itr
