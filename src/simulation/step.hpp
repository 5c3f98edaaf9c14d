// SPDX-License-Identifier: MIT
#pragma once

#include "itr/core.hpp"
#include "simulation/error_estimator.hpp"
#include "simulation/sizes.hpp"
#include "simulation/state.hpp"
#include "simulation/step_ladder.hpp"
#include "simulation/step_problem.hpp"

namespace itr {

/// Tools that all steps of a simulation share.
template <int Dim>
struct StepTools {
  const StepSetup<Dim>& setup;
  EdgeLengths initial_edges;  ///< of the mesh that the simulation begins with
  ProblemCache<Dim>& cache;
  linear::ReusingSolver& solver;  ///< that of `cache`
  const Logger& logger;
  ErrorEstimator<Dim>* errors = nullptr;  ///< null: nobody asks for error bars

  /// Tools for a part of a step.
  StepTools with(const StepSetup<Dim>& part) const { return {part, initial_edges, cache, solver, logger, errors}; }
};

/// One step of paper Algorithm 1: solve, remesh where that lowers the step's energy, project the history, solve again. If
/// that fails, StepLadder says how the step is taken next, from `attempt` down. From `before` to `after`, which may be the
/// same and on failure is left as it was. `start`, if there is one, gets the state before the step as it is on the mesh at
/// the end of it; such a step is not cut.
template <int Dim>
StepResult take_step(const StepTools<Dim>& tools, const State<Dim>& before, State<Dim>& after, State<Dim>* start = nullptr,
                     Attempt attempt = {});

/// Takes the step whose attempts have ended with `failed` as two of half the length; `attempt` is the first for each of
/// them.
template <int Dim>
StepResult take_step_in_halves(const StepTools<Dim>& tools, const State<Dim>& before, State<Dim>& after,
                               const Attempt& attempt, StepResult failed);

/// Takes the adaptive step whose attempts have ended with `failed` as a shorter one, of a part of its length.
template <int Dim>
StepResult take_shorter_step(const StepTools<Dim>& tools, const State<Dim>& before, State<Dim>& after, State<Dim>* start,
                             const Attempt& attempt, StepResult failed);

/// Where forces that act as in the last step lead to from x, with the history and the number of the step. Without inertia,
/// where the last motion goes on: not in the first step, by Newmark, or where the mesh changes between steps. Empty in
/// statics.
template <int Dim>
VectorX expected_positions(const StepSetup<Dim>& setup, const State<Dim>& step, const VectorX& x);

/// Adds the effort of an attempt whose state is dropped: its operations led nowhere.
void add_dropped(StepReport dropped, StepReport& report);

}  // namespace itr
