// SPDX-License-Identifier: MIT
#pragma once

#include <span>

#include <array>

#include "itr/simulation/simulation.hpp"

namespace itr {

/// Of the forces of FieldOptions at the end of a step, all four kinds of them, on some vertices.
template <int Dim>
struct Resultant {
  Vec<Dim> force = Vec<Dim>::Zero();                                 ///< [N]; 2D: by thickness
  Vec<Dim == 2 ? 1 : 3> moment = Vec < Dim == 2 ? 1 : 3 > ::Zero();  ///< of them [N m]; 2D: about the axis out of the plane
};

/// On the boundary facets with these tags: what contact, friction, held components, tractions, pressures and the program do
/// to their vertices, each of which counts once (those that other facets share, too), by its moment about `about` [m]. Over
/// the whole boundary, and with body forces and the program's forces inside, that is the rate of the bodies' momentum.
/// Throws InputError where the setup does not ask for the four kinds of forces.
template <int Dim>
Resultant<Dim> resultant(const Simulation<Dim>& simulation, std::span<const int> tags, const Vec<Dim>& about);

/// On the vertices of a target, by kind.
template <int Dim>
struct ForceSums {
  Resultant<Dim> contact, friction, reaction, all;  ///< all: with tractions, pressures and the program's forces
};
/// Of obstacles there are contact and friction: what the bodies do to them. Throws as above.
template <int Dim>
ForceSums<Dim> force_sums(const Simulation<Dim>& simulation, const ForceTarget& target);

}  // namespace itr
