// SPDX-License-Identifier: MIT
#pragma once

#include "simulation/state.hpp"

namespace itr {

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
