// SPDX-License-Identifier: MIT
#pragma once

#include "itr/core/log.hpp"
#include "itr/simulation/simulation.hpp"
#include "simulation/step_problem.hpp"

namespace itr {

/// Edge lengths of the mesh that a simulation begins with [m].
struct EdgeLengths {
  double shortest = 0, longest = 0;
};
template <int Dim>
EdgeLengths edge_lengths(const Mesh<Dim>& mesh);

/// Tools that all steps of a simulation share.
template <int Dim>
struct StepTools {
  const StepSetup<Dim>& setup;
  EdgeLengths initial_edges;
  ProblemCache<Dim>& cache;
  linear::ReusingSolver& solver;  ///< that of `cache`
  const Logger& logger;
};

/// One step of paper Algorithm 1: solve, remesh where that lowers the step's energy, project the history, solve again.
/// From `before` to `after`, which may be the same and on failure is left as it was. `damped`: Newmark leaves the step to
/// implicit Euler. `start`, if there is one, gets the state before the step as it is on the mesh at the end of it.
template <int Dim>
StepResult take_step(const StepTools<Dim>& tools, const State<Dim>& before, State<Dim>& after, bool damped = false,
                     State<Dim>* start = nullptr);

/// Takes a step; one whose solve fails is cut into smaller ones, as TimeOptions::step_cuts allows and the logger is told.
template <int Dim>
StepResult take_step_in_parts(const StepTools<Dim>& tools, const State<Dim>& before, State<Dim>& after, bool damped = false);

}  // namespace itr
