// SPDX-License-Identifier: MIT
// Which corner of a tetrahedron is the last one in PolyFEM's order: ideal cells (docs/theory.md) depend on it.
#pragma once

#include "../node.hpp"
#include "itr/mesh.hpp"

namespace itr::scene {

/// Whether a material asks for it.
bool has_ideal_cells(const Node& root);

/// Puts PolyFEM's last corner behind the others in cells of a mesh that is refined `times` times, from `first` on in the
/// list, in which `refined` may be repeated with shifted vertices. `cells` are those before the refinement with their
/// corners in the order of the file.
void order_cells(const std::vector<Vec<3>>& points, const std::vector<Mesh<3>::Cell>& cells, int times,
                 const Mesh<3>& refined, std::vector<Mesh<3>::Cell>& list, std::size_t first);

}  // namespace itr::scene
