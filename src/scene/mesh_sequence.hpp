// SPDX-License-Identifier: MIT
// Obstacles that move as a row of mesh files says, which differ in the places of their vertices (docs/theory.md, "Meshes").
#pragma once

#include "geometry.hpp"

namespace itr::scene {

/// Makes `mesh_sequence` of each geometry of this type the list of its files, [{"mesh": path}, ...], and `mesh` the first of
/// them. A folder stands for its files, a name with * for those that it matches, in the order of the numbers in their names.
/// Throws InputError where there is none.
void expand_mesh_sequences(Document& document);

/// Whether the geometry is one.
bool is_mesh_sequence(const Node& geometry);

/// Gives the vertices from `first` on, which are those of the first file that `is_used` marks, the motions of a sequence:
/// from frame to frame on a straight line, `fps` frames a unit of time, at rest after the last. Throws InputError for a file
/// of other elements.
template <int Dim>
void add_sequence(const Node& geometry, MeshFiles& files, const std::vector<char>& is_used, std::size_t first,
                  Obstacles<Dim>& obstacles);

}  // namespace itr::scene
