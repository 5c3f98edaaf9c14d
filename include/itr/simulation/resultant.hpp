// SPDX-License-Identifier: MIT
#pragma once

#include <span>

#include <array>

#include "itr/simulation/simulation.hpp"

namespace itr {

/// Sum of the four kinds of forces of FieldOptions on some vertices, at the end of a step.
template <int Dim>
struct Resultant {
  Vec<Dim> force = Vec<Dim>::Zero();                                 ///< [N]; 2D: by thickness
  Vec<Dim == 2 ? 1 : 3> moment = Vec < Dim == 2 ? 1 : 3 > ::Zero();  ///< of them [N m]; 2D: about the axis out of the plane
};

/// Returns the sum of contact, friction, reactions, tractions, pressures and forces of the program on the vertices of the
/// boundary facets with these tags, and its moment about `about` [m]. A vertex counts once, also if other facets share it.
/// Over the whole boundary, together with body forces and the program's forces inside, it is the rate of the bodies'
/// momentum. Throws InputError for tags that no facet has, and if the setup does not ask for the four kinds of forces.
template <int Dim>
Resultant<Dim> resultant(const Simulation<Dim>& simulation, std::span<const int> tags, const Vec<Dim>& about);

/// Sums of forces on the vertices of a target, by kind.
template <int Dim>
struct ForceSums {
  Resultant<Dim> contact, friction, reaction, all;  ///< all: with tractions, pressures and the program's forces
  Resultant<Dim> body, residual;                    ///< NodalForces: body forces, and what the solve left
  Resultant<Dim> remeshing;                         ///< NodalForces::remeshing of the target's bodies
};
/// Obstacles have contact and friction only: the forces of the bodies on them. Throws InputError as above, also for bodies
/// and vertices of obstacles that are not there.
template <int Dim>
ForceSums<Dim> force_sums(const State<Dim>& state, const NodalForces& forces, const ForceTarget& target);

}  // namespace itr
