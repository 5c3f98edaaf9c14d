// SPDX-License-Identifier: MIT
#include "patch.hpp"

#include <algorithm>

namespace itr {

template <int Dim>
void select_patch(const Mesh<Dim>& mesh, const Edit<Dim>& edit, const LocalRelaxationOptions& options, Marks& marks,
                  std::vector<CellId>& patch) {
  marks.clear(mesh.cell_slots());
  patch.clear();
  const auto add = [&](CellId c) {
    if (marks.mark(c)) patch.push_back(c);
  };
  for (const CellId c : edit.removed_cells) add(c);
  // Ring 1 is these cells; each further one goes over the vertices of the last.
  std::size_t ring_begin = 0;
  const auto most = static_cast<std::size_t>(options.max_cells);
  for (int ring = 1; ring < options.rings && patch.size() < most; ++ring) {
    const std::size_t ring_end = patch.size();
    for (std::size_t i = ring_begin; i < ring_end; ++i)
      for (const int v : mesh.cell(patch[i]))
        for (const CellId c : mesh.cells_of(v)) add(c);
    ring_begin = ring_end;
  }
  std::sort(patch.begin(), patch.end());
}

template void select_patch(const Mesh<2>&, const Edit<2>&, const LocalRelaxationOptions&, Marks&, std::vector<CellId>&);
template void select_patch(const Mesh<3>&, const Edit<3>&, const LocalRelaxationOptions&, Marks&, std::vector<CellId>&);

}  // namespace itr
