// SPDX-License-Identifier: MIT
#pragma once

#include <span>
#include <vector>

#include "itr/mesh/mesh.hpp"
#include "itr/remesh/options.hpp"
#include "marks.hpp"

namespace itr {

/// The support of a trial, ascending: `options.rings` rings around the seeds, as many whole rings as stay below
/// `options.max_cells`; with a `relative_volume` also the cells within the ball of that share of the total around `center`
/// (rest shape), grown to that volume (paper §4.3). Both sides of a comparison use it.
template <int Dim>
void select_patch(const Mesh<Dim>& mesh, std::span<const CellId> seeds, const Vec<Dim>& center, double total_volume,
                  const LocalRelaxationOptions& options, Marks& marks, std::vector<CellId>& patch);
template <int Dim>
std::vector<CellId> select_patch(const Mesh<Dim>& mesh, std::span<const CellId> seeds, const Vec<Dim>& center,
                                 double total_volume, const LocalRelaxationOptions& options, Marks& marks) {
  std::vector<CellId> patch;
  select_patch(mesh, seeds, center, total_volume, options, marks, patch);
  return patch;
}

}  // namespace itr
