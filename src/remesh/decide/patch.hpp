// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include "itr/mesh.hpp"
#include "itr/options.hpp"
#include "remesh/marks.hpp"

namespace itr {

/// The support of a trial, ascending: `options.rings` rings around the cells that the edit removes, as many whole rings as
/// stay below `options.max_cells`. Both sides of a comparison use it.
template <int Dim>
void select_patch(const Mesh<Dim>& mesh, const Edit<Dim>& edit, const LocalRelaxationOptions& options, Marks& marks,
                  std::vector<CellId>& patch);
template <int Dim>
std::vector<CellId> select_patch(const Mesh<Dim>& mesh, const Edit<Dim>& edit, const LocalRelaxationOptions& options,
                                 Marks& marks) {
  std::vector<CellId> patch;
  select_patch(mesh, edit, options, marks, patch);
  return patch;
}

}  // namespace itr
