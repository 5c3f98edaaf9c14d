// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <set>
#include <span>
#include <vector>

#include "itr/setup.hpp"
#include "node.hpp"
#include "sets.hpp"

namespace itr::scene {

/// The fluid of an entry of `pressure_boundary` on facets with these tags (docs/theory.md, "Conditions");
/// nothing where it does not penetrate. `with_facets`: tags of the mesh. Throws InputError for keys of a fluid without one,
/// and where one of the `others` is.
std::optional<Fluid> read_fluid(const Node& node, const std::vector<int>& tags, const Sets& sets,
                                const std::set<int>& with_facets, std::span<const Fluid> others);

}  // namespace itr::scene
