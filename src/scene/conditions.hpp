// SPDX-License-Identifier: MIT
// `boundary_conditions`, `initial_conditions` and the motion of obstacles (docs/theory.md, "Conditions").
#pragma once

#include "geometry.hpp"
#include "itr/setup.hpp"

namespace itr::scene {

/// Fills the conditions and the obstacles of a setup whose mesh and time are read.
template <int Dim>
void read_conditions(const Node& root, const Sets& sets, ObstacleGeometry<Dim> obstacles, Setup<Dim>& setup,
                     std::vector<std::string>& warnings);

}  // namespace itr::scene
