// SPDX-License-Identifier: MIT
// Combinations of features that no simulation takes: one table, for the check and for the page docs/scenes.md.
#pragma once

#include <vector>

#include "itr/setup.hpp"
#include "simulation/step.hpp"

namespace itr {

struct UnsupportedCombination {
  const char* place;  ///< JSON pointer of the key that a scene would have to drop, or the field of a Setup
  const char* words;  ///< what is refused, as the error message names it
};
/// In the order in which they are checked.
std::vector<UnsupportedCombination> unsupported_combinations();

/// Whether gaps can be averaged: ContactOptions::average_gaps.
template <int Dim>
bool can_average_gaps(const Setup<Dim>& setup);

/// Throws InputError for the first combination that the setup has.
template <int Dim>
void refuse_unsupported(const Setup<Dim>& setup);
/// Refuses a state to go on from in the same way: its edges may be curved where the setup would curve none.
template <int Dim>
void refuse_unsupported(const Setup<Dim>& setup, const State<Dim>& state);

}  // namespace itr
