// SPDX-License-Identifier: MIT
// `/output/forces`: whose forces are summed.
#pragma once

#include "geometry.hpp"
#include "itr/scene.hpp"

namespace itr::scene {

/// Names of sets go before those of geometries, of which one that several have is that of the first. Bodies whose
/// `volume_selection` is no single id have none.
template <int Dim>
PartNames name_parts(const Geometries& geometries, const ObstacleGeometry<Dim>& obstacles, const Sets& sets);

/// Throws InputError for what nothing has, and for names that are there twice.
template <int Dim>
std::vector<ForceTarget> read_forces(const Node& root, const PartNames& parts, const Sets& sets, const Mesh<Dim>& mesh);

}  // namespace itr::scene
