// SPDX-License-Identifier: MIT
// `/output/forces`: whose forces are summed.
#pragma once

#include "geometry.hpp"

namespace itr::scene {

/// Throws InputError for what nothing has, and for names that are there twice.
template <int Dim>
std::vector<ForceTarget> read_forces(const Node& root, const Geometries& geometries, const ObstacleGeometry<Dim>& obstacles,
                                     const Mesh<Dim>& mesh);

}  // namespace itr::scene
