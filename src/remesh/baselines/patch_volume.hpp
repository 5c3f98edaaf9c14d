// SPDX-License-Identifier: MIT
// The paper's patches (§4.3): a share of the total volume, not rings alone.
#pragma once

#include <vector>

#include "itr/mesh/mesh.hpp"
#include "remesh/marks.hpp"

namespace itr {

/// Adds the cells within the ball of volume `target` [m^Dim] around an edit (rest shape), and more up to that volume. Cells
/// of the patch are marked.
template <int Dim>
void grow_to_volume(const Mesh<Dim>& mesh, const Edit<Dim>& edit, double target, Marks& marks, std::vector<CellId>& patch);

}  // namespace itr
