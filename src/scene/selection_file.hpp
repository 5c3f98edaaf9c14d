// SPDX-License-Identifier: MIT
#pragma once

#include "geometry.hpp"

namespace itr::scene {

/// The file of ids that a selection of a geometry names instead of rules, as "ids.txt" or {"id": "ids.txt", "id_offset": 2};
/// absent where it names none.
Node find_selection_file(const Node& selection);

/// Whether a selection of the geometry names one.
bool has_selection_files(const Node& geometry);

/// Adds what such files of `volume_selection`, `surface_selection` and `point_selection` say to the groups of the mesh file:
/// a line is an id, or an id and the vertices of the cell, facet or point that has it. Throws InputError for other lines.
void add_selection_files(const Node& geometry, int dim, MeshFile& file);

}  // namespace itr::scene
