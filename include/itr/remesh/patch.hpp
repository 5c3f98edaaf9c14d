// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include "itr/mesh/mesh.hpp"
#include "itr/remesh/local_problem.hpp"
#include "itr/remesh/options.hpp"

namespace itr {

/// The support of a trial, ascending: cells within the disc of `options.relative_volume` of the total around `center` (rest
/// shape), grown to that volume, and `options.rings` rings around the seeds (paper §4.3). Both sides of a comparison use it.
std::vector<CellId> select_patch(const Mesh<2>& mesh, const std::vector<CellId>& seeds, const Vec<2>& center,
                                 double total_volume, const LocalRelaxationOptions& options, Marks& marks);

}  // namespace itr
