// SPDX-License-Identifier: MIT
// The end of a step of bodies that remember: viscoelastic ones relax, and large densities soften others.
#pragma once

#include "itr/frame.hpp"
#include "itr/setup.hpp"
#include "simulation/state.hpp"

namespace itr {

/// Replaces what bodies keep of their past in `next`, on its mesh and with its history before the step, by that at the end
/// of the step to x, and reports what they dissipated and lost. `start`, unless null, gets the same of the time `t` before
/// the step on that mesh.
template <int Dim>
void end_pasts(const StepSetup<Dim>& setup, const VectorX& x, double t, State<Dim>& next, State<Dim>* start,
               StepReport& report);

}  // namespace itr
