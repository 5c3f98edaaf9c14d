// SPDX-License-Identifier: MIT
#pragma once

#include "itr/core/log.hpp"
#include "itr/simulation/simulation.hpp"
#include "itr/simulation/step_problem.hpp"

namespace itr {

/// One step of paper Algorithm 1: solve, remesh where that lowers the step's energy, project the history, solve again.
/// `shortest_edge` is that of the initial mesh [m], `solver` that of `system`. `damped`: Newmark leaves the step
/// to implicit Euler. On failure `state` is left as it was. `start`, if there is one, gets the state before the step as it
/// is on the mesh at the end of it.
template <int Dim>
StepResult take_step(const Setup<Dim>& setup, double shortest_edge, SparseSystem& system, linear::ReusingSolver& solver,
                     const Logger& logger, State<Dim>& state, bool damped = false, State<Dim>* start = nullptr);

/// That, with a step whose solve fails cut into smaller ones, as TimeOptions::step_cuts allows and `logger` is told.
template <int Dim>
StepResult take_step_in_parts(const Setup<Dim>& setup, double shortest_edge, SparseSystem& system,
                              linear::ReusingSolver& solver, const Logger& logger, State<Dim>& state, bool damped = false);

/// Most memory that this process has held [MB].
double peak_rss_mb();

}  // namespace itr
