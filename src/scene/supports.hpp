// SPDX-License-Identifier: MIT
// `/springs` and `/couplings` of a scene (docs/theory.md, "Springs" and "Coupled points").
#pragma once

#include <set>
#include <string>
#include <vector>

#include "energy/support.hpp"
#include "itr/setup.hpp"
#include "node.hpp"
#include "sets.hpp"

namespace itr::scene {

/// The tags of surfaces of bodies that ids name, ascending. Throws InputError for ids that no surface of a body has, and for
/// none.
std::vector<int> read_surfaces(const Node& node, const Sets& sets, const std::set<int>& with_facets,
                               const std::string& expected);

/// The name of an entry's curve in forces.csv: by default `what` and the first of its ids.
std::string read_curve_name(const Node& node, const std::string& what);

/// Fills in both for a setup whose mesh and time are read.
template <int Dim>
void read_supports(const Node& root, const Sets& sets, Setup<Dim>& setup);

}  // namespace itr::scene
