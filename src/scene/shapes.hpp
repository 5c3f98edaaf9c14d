// SPDX-License-Identifier: MIT
// `/shapes` of a scene (docs/theory.md, "True shapes").
#pragma once

#include "itr/setup.hpp"
#include "node.hpp"
#include "sets.hpp"

namespace itr::scene {

/// Adds the shapes to a setup whose mesh is read. Throws InputError for ids that no surface of a body has, for what a type
/// lacks, and for surfaces in two shapes.
template <int Dim>
void read_shapes(const Node& root, const Sets& sets, Setup<Dim>& setup);

}  // namespace itr::scene
