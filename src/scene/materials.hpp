// SPDX-License-Identifier: MIT
// `materials` of a scene (docs/theory.md, "Materials").
#pragma once

#include <map>

#include "itr/scene.hpp"
#include "node.hpp"
#include "sets.hpp"

namespace itr::scene {

/// By body id. InputError for a body of the mesh without one, and for moduli or densities out of range; those that vary are
/// looked at in every element.
template <int Dim>
std::map<int, Material> read_materials(const Node& root, const LabelIds& bodies, const Mesh<Dim>& mesh,
                                       std::vector<std::string>& warnings);

}  // namespace itr::scene
