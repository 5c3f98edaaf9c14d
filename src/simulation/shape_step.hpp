// SPDX-License-Identifier: MIT
// The part of a step that puts surfaces onto their shapes.
#pragma once

#include "itr/setup.hpp"
#include "remesh/shapes.hpp"
#include "simulation/remesh_step.hpp"
#include "simulation/state.hpp"

namespace itr {

/// Corrects velocities and accelerations of a state whose surfaces were put onto shapes: linear and angular momentum of each
/// body become those of `before` and those of the material that came or went, with its own velocities. Moved vertices drag
/// the functions of their cells along, which changes the momenta of what was there before to second order. A rigid motion
/// of the nodes of these cells takes that back. Around an axis only momentum along it counts.
template <int Dim>
void keep_momenta(const StepSetup<Dim>& setup, const State<Dim>& before, const AddedMaterial<Dim>& added, State<Dim>& state);

/// Puts surfaces onto their shapes around x, see put_on_shapes; else as remesh_and_project. The momenta of the bodies change
/// by those of the material that comes or goes, and by nothing else.
template <int Dim>
std::optional<MeshRenumbering> shape_and_project(const StepTools<Dim>& tools, const StepProblem<Dim>& problem,
                                                 const State<Dim>& before, State<Dim>& state, VectorX& x,
                                                 StepReport& report);

}  // namespace itr
