// SPDX-License-Identifier: MIT
// Bodies that touch or overlap at the start (ContactOptions::resolve_overlap; docs/theory.md, "Press fits").
#pragma once

#include "simulation/step.hpp"

namespace itr {

/// The least depth by which two solids overlap at rest; infinite where none do [m].
template <int Dim>
double least_overlap(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh);

/// Moves the bodies of an initial state to the static equilibrium of their interference, without loads and friction, and
/// says so in the log. Rest shapes stay. Returns the energy that bodies and contact store there [J]; nothing changes where
/// no surfaces touch. Throws InputError with the reason where there is no such state.
template <int Dim>
double resolve_overlap(const StepTools<Dim>& tools, State<Dim>& state);

}  // namespace itr
