// SPDX-License-Identifier: MIT
// `materials/eigenstrain` (docs/theory.md, "Eigenstrain").
#pragma once

#include <vector>

#include "itr/options.hpp"
#include "node.hpp"

namespace itr::scene {

/// Gives a material whose law is read the eigenstrain of its entry, if there is one. InputError for components that it
/// cannot have; those that vary are checked wherever they are used. `dimension`: 3 in axisymmetric scenes, too.
void read_eigenstrain(const Node& entry, int dimension, Material& material);

/// The values of all eigenstrains of a scene.
std::vector<Node> eigenstrain_components(const Node& root);

}  // namespace itr::scene
