// SPDX-License-Identifier: MIT
#pragma once

#include "simulation/state.hpp"
#include "simulation/step_problem.hpp"

namespace itr {

/// Makes state.history.a[0] solve M a = f with all forces of the setup at the start: elastic, loads, contact, friction and
/// damping. Held dofs keep theirs. Throws InputError with the reason where that has no solution.
template <int Dim>
void set_consistent_acceleration(const Setup<Dim>& setup, State<Dim>& state, ProblemCache<Dim>& cache);

}  // namespace itr
