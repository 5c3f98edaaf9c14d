// SPDX-License-Identifier: MIT
// The middle of a time step: remesh where that lowers the step's energy, carry the state over to the new mesh.
#pragma once

#include "itr/core/log.hpp"
#include "itr/linear/solver.hpp"
#include "itr/remesh/report.hpp"
#include "itr/simulation/simulation.hpp"
#include "itr/simulation/step_problem.hpp"

namespace itr {

/// Remeshes state.mesh, around the solution x of `problem` at time t, and carries state.history and x over to the new mesh.
/// `shortest_edge` is that of the initial mesh [m]. 2D so far.
template <int Dim>
RemeshReport remesh_and_project(const Setup<Dim>& setup, double shortest_edge, const StepProblem<Dim>& problem, double t,
                                State<Dim>& state, VectorX& x, StepSeconds& seconds, linear::Solver& solver,
                                const Logger& logger);

}  // namespace itr
