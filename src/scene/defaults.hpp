// SPDX-License-Identifier: MIT
// The two sets of defaults. PolyFEM's are those of the table of keys, which the readers have; ITR's are the rows of
// defaults.cpp, put into a scene before it is read.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "itr/scene.hpp"
#include "node.hpp"

namespace itr::scene {

/// A value that ITR's set gives a key that a scene leaves out.
struct Default {
  const char* pointer;                  ///< of a row of the table of keys
  const char* value;                    ///< JSON
  bool (*is_needed)(const Node& root);  ///< whether the scene models what the key is of
  const char* reason;
};
std::span<const Default> itr_defaults();

/// Names of the sets: "itr" and "polyfem" for the newest version of each, or with the version as in "itr-1".
const std::vector<std::string>& names_of_sets();

/// Whether a scene chooses PolyFEM's set.
bool is_polyfem_set(const Node& root);
/// Whether nearly incompressible bodies average their volume over patches where a material does not say.
bool averages_volume(const Node& root);

/// Puts the set that a checked scene chooses into it, and tells which one and what.
ChosenDefaults apply_defaults(Document& document);

}  // namespace itr::scene
