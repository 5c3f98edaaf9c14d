// SPDX-License-Identifier: MIT
// The middle of a time step: remesh where that lowers the step's energy, carry the state over to the new mesh.
#pragma once

#include "itr/core/log.hpp"
#include "itr/linear/solver.hpp"
#include "itr/simulation/simulation.hpp"
#include "itr/simulation/step_problem.hpp"

namespace itr {

/// Remeshes state.mesh, around the solution x of `problem` at time t, and carries state.history and x over to the new mesh;
/// `before` is the state as it is. Returns what became of its ids; nothing where nothing changed. `report` gets operations,
/// forgotten history and seconds. `shortest_edge` is that of the initial mesh [m].
template <int Dim>
std::optional<MeshRenumbering> remesh_and_project(const Setup<Dim>& setup, double shortest_edge,
                                                  const StepProblem<Dim>& problem, double t, const State<Dim>& before,
                                                  State<Dim>& state, VectorX& x, StepReport& report, linear::Solver& solver,
                                                  const Logger& logger);

}  // namespace itr
