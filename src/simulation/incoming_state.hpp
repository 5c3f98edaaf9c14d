// SPDX-License-Identifier: MIT
// States that no step made: the initial one, and a saved one that is restored.
#pragma once

#include "itr/setup.hpp"
#include "simulation/state.hpp"
#include "simulation/step.hpp"
#include "simulation/step_problem.hpp"

namespace itr {

/// The state at the setup's start time, by its initial conditions.
template <int Dim>
State<Dim> initial_state(const Setup<Dim>& setup);
/// The setup's mesh, compact and with the curved edges that its orders ask for.
template <int Dim>
Mesh<Dim> initial_mesh(const Setup<Dim>& setup);

/// Throws InputError where surfaces of the state intersect, or a body or obstacle is inside of a body. Checks nothing where
/// contact is not enabled.
template <int Dim>
void refuse_intersections(const Setup<Dim>& setup, const State<Dim>& state);

/// Throws InputError for displacements, velocities or accelerations that tear ties.
template <int Dim>
void refuse_open_ties(const Setup<Dim>& setup, const State<Dim>& state);

/// Throws InputError for a state that no steps of this setup lead to.
template <int Dim>
void refuse_misfit(const Setup<Dim>& setup, const State<Dim>& state);

/// Makes state.history.a[0] solve M a = f with all forces of the setup at the start: elastic, loads, contact, friction and
/// damping. Held dofs keep theirs. Throws InputError with the reason where that has no solution.
template <int Dim>
void set_consistent_acceleration(const Setup<Dim>& setup, State<Dim>& state, ProblemCache<Dim>& cache);

}  // namespace itr
