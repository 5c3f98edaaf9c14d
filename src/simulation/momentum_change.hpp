// SPDX-License-Identifier: MIT
#pragma once

#include "itr/transfer.hpp"
#include "simulation/state.hpp"

namespace itr {

/// Changes by edits, between two states at the start of a step, of the momentum that bodies would have at its end without
/// forces: for the bodies of `touched`, as an impulse over the step.
template <int Dim>
std::vector<MomentumChange> momentum_changes(const StepSetup<Dim>& setup, const State<Dim>& before, const State<Dim>& after,
                                             const TouchedCells& touched);

}  // namespace itr
