// SPDX-License-Identifier: MIT
// PolyFEM's AMIPS without a rest pose (docs/theory.md, "Ideal cells").
#pragma once

#include "energy/elastic/law_table.hpp"
#include "energy/elastic/laws.hpp"

namespace itr {

/// weight (tr F^T F / (det F)^(1 + 2/d) - d) of the F that set_ideal_cell gives.
const LawRow& ideal_cell_law();
/// Whether a material has this law, and nothing else.
bool is_of_ideal_cell(const Material& material);

/// Makes a law see F A instead of F. A = E S^-1 takes the ideal cell to the cell at rest: S are the edges of an equilateral
/// triangle of length 1, or of a tetrahedron above it that is sqrt(3)/2 high, E those of the cell from its first vertex.
template <int Dim>
void set_ideal_cell(const Mat<Dim>& inverse_edges, ElasticModuli& moduli);

}  // namespace itr
