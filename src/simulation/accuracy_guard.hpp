// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "simulation/state.hpp"
#include "simulation/step_ladder.hpp"
#include "simulation/step_problem.hpp"

namespace itr {

/// Judges an adaptive step by its errors in time, on the mesh before it, and says how long the next one may be.
template <int Dim>
class AccuracyGuard {
 public:
  /// `setup` and `start`, the state before the step, must outlive this.
  AccuracyGuard(const StepSetup<Dim>& setup, const State<Dim>& start, const Attempt& attempt)
      : time_(setup.time), before_(start.control), attempt_(attempt) {}

  bool is_on() const { return time_.adaptive.enabled; }
  /// Why the step to x, which `problem` has solved, is to be taken again; `has_system` as in StepProblem::time_errors.
  std::optional<StepFailure> find_inaccuracy(StepProblem<Dim>& problem, const History& history, const VectorX& x,
                                             bool has_system) {
    const TimeErrors found = problem.time_errors(history, x, has_system);
    energy_ = found.energy;
    const double largest = std::max({before_.energy, energy_, problem.energy_resolution()});
    errors_ = {.error = std::sqrt(found.local / largest) + found.work / (2 * largest),
               .impact = found.impact / largest,
               .resolving_dt = found.resolving_dt,
               .way_to_contact = found.way_to_contact};
    if (attempt_.method != StepMethod::of_setup) return std::nullopt;
    const auto shorter =
        StepController(time_).shorter(errors_, attempt_.trial, time_.dt, TimeIntegrator(time_).accuracy(history));
    if (!shorter) return std::nullopt;
    const bool is_impact = shorter->error == 0;
    return StepFailure{.kind = StepFailure::Kind::inaccurate,
                       .reason = is_impact ? "impact" : "error in time",
                       .nearly_inverted = {},
                       .trial = *shorter};
  }
  /// The local error of the step that was last judged, by what the largest energy so far gives.
  double error() const { return errors_.error; }
  /// Controls the length of the next step, if this one stands.
  StepControl control() const { return StepController(time_).after(before_, errors_, attempt_.trial, time_.dt, energy_); }
  /// Describes the step where it failed.
  RejectedStep rejection(const StepFailure& failure) const {
    const bool is_error = failure.kind == StepFailure::Kind::inaccurate;
    return {time_.dt, is_error ? errors_.error : std::numeric_limits<double>::quiet_NaN(), failure.reason};
  }

 private:
  const TimeOptions& time_;
  const StepControl& before_;
  Attempt attempt_;
  StepErrors errors_;
  double energy_ = 0;  ///< at the end of the step [J]
};

}  // namespace itr
