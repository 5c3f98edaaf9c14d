// SPDX-License-Identifier: MIT
#pragma once

#include "itr/core/log.hpp"
#include "itr/linear/solver.hpp"
#include "itr/projection/transfer.hpp"
#include "itr/simulation/step_problem.hpp"

namespace itr {

/// Replaces the bodies' part of `interpolated` (the history carried along by interpolation, on the compact `mesh`) by
/// its L2 projection from `old_mesh`: positions safely, velocities and accelerations freely. `new_cells` and `old_cells` are
/// those by which the two meshes differ.
void transfer_history(const Setup<2>& setup, const Mesh<2>& old_mesh, const History& old_history, const Mesh<2>& mesh,
                      const TouchedCells& touched, double scaling, linear::Solver& solver, const Logger& logger,
                      History& interpolated);

}  // namespace itr
