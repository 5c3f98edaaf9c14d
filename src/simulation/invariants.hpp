// SPDX-License-Identifier: MIT
#pragma once

#include <string>

#include "fem/chord_levels.hpp"
#include "itr/setup.hpp"

namespace itr {

/// Finds a violation in positions of bodies and obstacles, in words, decided exactly; empty: none. Cells are positively
/// oriented everywhere; with contact, surfaces do not cross, and no body or obstacle is inside of a body. Faces that were
/// closed `age` steps ago, when bodies were at x, may overlap by d-hat.
template <int Dim>
std::string find_violation(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const VectorX& x,
                           const ChordLevels& chords = {}, int age = 0);

}  // namespace itr
