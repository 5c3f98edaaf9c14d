// SPDX-License-Identifier: MIT
// Advice on setups that are legal but look like mistakes, and on their effects, in words.
#pragma once

#include <string>
#include <vector>

#include "simulation/state.hpp"

namespace itr::cli {

/// Units that are unusual, bad meshes, bodies that nothing holds, surfaces that push each other from the start: a sentence
/// each.
template <int Dim>
std::vector<std::string> find_suspicious(const Simulation<Dim>& simulation);

/// Accelerations, masses, waves against steps and elements, damping: a sentence each.
template <int Dim>
std::vector<std::string> foretell(const Setup<Dim>& setup);

}  // namespace itr::cli
