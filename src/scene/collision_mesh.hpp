// SPDX-License-Identifier: MIT
// `contact/collision_mesh`: a surface that touches in place of the bodies' boundary (docs/theory.md, "Contact").
#pragma once

#include <optional>

#include "geometry.hpp"

namespace itr::scene {

/// Whether the scene has a collision mesh that matters.
bool has_collision_mesh(const Node& root);

/// Its surface, transformed as the first geometry is, and its weights over the vertices of `mesh`, which must be those of
/// the bodies' files in their order. Nothing where the scene has none.
template <int Dim>
std::optional<CollisionProxy<Dim>> read_collision_mesh(const Node& root, const Geometries& geometries, const Mesh<Dim>& mesh,
                                                       MeshFiles& files, std::vector<std::string>& warnings);

}  // namespace itr::scene
