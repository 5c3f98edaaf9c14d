// SPDX-License-Identifier: MIT
#pragma once

#include <string>

#include "itr/setup.hpp"

namespace itr {

/// Whether gaps are to be averaged where a setup leaves it open: bodies slide, conditions hold each of them at the start,
/// and nothing that needs the boundary itself is asked for.
template <int Dim>
bool averaging_helps(const Setup<Dim>& setup);

/// Gives a setup in 2D that asks for averaged gaps a proxy behind the boundary of its bodies, of which they act
/// (docs/theory.md, "Averaged gaps"); where its mesh does not suit them, it asks for them no longer. Returns the choice in
/// words.
template <int Dim>
std::string retract_surfaces(Setup<Dim>& setup);

}  // namespace itr
