// SPDX-License-Identifier: MIT
#pragma once

#include "itr/core/log.hpp"
#include "itr/linear/solver.hpp"
#include "itr/projection/transfer.hpp"
#include "itr/simulation/step_problem.hpp"

namespace itr {

/// Replaces the bodies' part of `history`, carried along by interpolation onto the compact `mesh`, by its L2 projection from
/// `old_mesh`: positions safely, velocities and accelerations freely. `touched` are the cells by which the meshes differ,
/// `step` is the problem on the old one.
void transfer_history(const Setup<2>& setup, const Mesh<2>& old_mesh, const History& old_history, const Mesh<2>& mesh,
                      const TouchedCells& touched, const StepProblem<2>& step, linear::Solver& solver, const Logger& logger,
                      History& history);

}  // namespace itr
