// SPDX-License-Identifier: MIT
#include "itr/remesh/patch.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "itr/geometry/distance.hpp"

namespace itr {

namespace {

bool meets_disc(const Mesh<2>& mesh, CellId c, const Vec<2>& center, double radius_squared) {
  const auto& cell = mesh.cell(c);
  for (int k = 0; k < 3; ++k)
    if (point_edge_distance_squared<2>(center, mesh.rest(cell[k]), mesh.rest(cell[(k + 1) % 3])) <= radius_squared)
      return true;
  const Vec<2> weights = mesh.inverse_rest_edges(c) * (center - mesh.rest(cell[0]));
  return weights[0] >= 0 && weights[1] >= 0 && weights.sum() <= 1;
}

}  // namespace

std::vector<CellId> select_patch(const Mesh<2>& mesh, const std::vector<CellId>& seeds, const Vec<2>& center,
                                 double total_volume, const LocalRelaxationOptions& options, Marks& marks) {
  const double target = options.relative_volume * total_volume, radius_squared = target / std::numbers::pi;
  marks.clear(mesh.cell_slots());
  std::vector<CellId> patch;
  double volume = 0;
  const auto add = [&](CellId c) {
    if (!marks.mark(c)) return;
    patch.push_back(c);
    volume += mesh.volume(c);
  };
  for (const CellId c : seeds) add(c);
  // The rings first (ring 1 is the seeds themselves); each further one goes over the vertices of the last.
  std::size_t ring_begin = 0;
  for (int ring = 1; ring < options.rings; ++ring) {
    const std::size_t ring_end = patch.size();
    for (std::size_t i = ring_begin; i < ring_end; ++i)
      for (const int v : mesh.cell(patch[i]))
        for (const CellId c : mesh.cells_of(v)) add(c);
    ring_begin = ring_end;
  }
  // Then outward: cells that meet the disc, and whatever comes next while the volume is too small.
  for (std::size_t i = 0; i < patch.size(); ++i) {
    const auto cell = mesh.cell(patch[i]);
    for (const int v : cell)
      for (const CellId c : mesh.cells_of(v))
        if (!marks[c] && (volume < target || meets_disc(mesh, c, center, radius_squared))) add(c);
  }
  std::sort(patch.begin(), patch.end());
  return patch;
}

}  // namespace itr
