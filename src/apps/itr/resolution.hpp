// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

#include "simulation/state.hpp"

namespace itr::cli {

/// Adds a sentence where what moves or strains bodies in a step is lost, or nearly lost, in the round-off of positions.
/// Estimates, from the conditions at the end of the first step and of the last one.
template <int Dim>
void find_unresolved(const Simulation<Dim>& simulation, std::vector<std::string>& found);

}  // namespace itr::cli
