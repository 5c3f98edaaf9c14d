// SPDX-License-Identifier: MIT
// PolyFEM's periodic boundaries and its macroscopic displacement gradient, which become ties (docs/theory.md, "Ties").
#pragma once

#include "../readers.hpp"

namespace itr::scene {

/// Ties opposite sides of the bodies' box, or of `boundary_conditions/periodic`. Components of the gradient that are not
/// fixed are free; of two that a rotation mixes one stays as it is given. Holds a vertex where nothing else holds the
/// bodies.
template <int Dim>
void read_periodic_boundary(const Node& root, const Sets& sets, Setup<Dim>& setup);

}  // namespace itr::scene
