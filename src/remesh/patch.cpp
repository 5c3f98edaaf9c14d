// SPDX-License-Identifier: MIT
#include "patch.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "itr/geometry/distance.hpp"

namespace itr {

namespace {

bool meets_boundary(const std::array<Vec<2>, 3>& p, const Vec<2>& center, double radius_squared) {
  for (int k = 0; k < 3; ++k)
    if (point_edge_distance_squared<2>(center, p[k], p[(k + 1) % 3]) <= radius_squared) return true;
  return false;
}
bool meets_boundary(const std::array<Vec<3>, 4>& p, const Vec<3>& center, double radius_squared) {
  for (int k = 0; k < 4; ++k) {
    const std::array<Vec<3>, 4> pair{center, p[(k + 1) % 4], p[(k + 2) % 4], p[(k + 3) % 4]};
    if (pair_distance_squared<3>(PairKind::face_vertex, pair.data()) <= radius_squared) return true;
  }
  return false;
}

template <int Dim>
bool meets_ball(const Mesh<Dim>& mesh, CellId c, const Vec<Dim>& center, double radius_squared) {
  std::array<Vec<Dim>, Dim + 1> p;
  for (int k = 0; k <= Dim; ++k) p[k] = mesh.rest(mesh.cell(c)[k]);
  const Vec<Dim> weights = mesh.inverse_rest_edges(c) * (center - p[0]);
  return (weights.minCoeff() >= 0 && weights.sum() <= 1) || meets_boundary(p, center, radius_squared);
}

template <int Dim>
double radius_squared_of(double volume) {
  return Dim == 2 ? volume / std::numbers::pi : std::pow(3 * volume / (4 * std::numbers::pi), 2.0 / 3);
}

}  // namespace

template <int Dim>
void select_patch(const Mesh<Dim>& mesh, std::span<const CellId> seeds, const Vec<Dim>& center, double total_volume,
                  const LocalRelaxationOptions& options, Marks& marks, std::vector<CellId>& patch) {
  marks.clear(mesh.cell_slots());
  patch.clear();
  double volume = 0;
  const auto add = [&](CellId c) {
    if (!marks.mark(c)) return;
    patch.push_back(c);
    volume += mesh.volume(c);
  };
  for (const CellId c : seeds) add(c);
  // The rings first (ring 1 is the seeds themselves); each further one goes over the vertices of the last.
  std::size_t ring_begin = 0;
  const auto most = static_cast<std::size_t>(options.max_cells);
  for (int ring = 1; ring < options.rings && patch.size() < most; ++ring) {
    const std::size_t ring_end = patch.size();
    for (std::size_t i = ring_begin; i < ring_end; ++i)
      for (const int v : mesh.cell(patch[i]))
        for (const CellId c : mesh.cells_of(v)) add(c);
    ring_begin = ring_end;
  }
  // Then outward: cells that meet the ball, and whatever comes next while the volume is too small.
  if (options.relative_volume > 0) {
    const double target = options.relative_volume * total_volume, radius_squared = radius_squared_of<Dim>(target);
    for (std::size_t i = 0; i < patch.size(); ++i) {
      const auto cell = mesh.cell(patch[i]);
      for (const int v : cell)
        for (const CellId c : mesh.cells_of(v))
          if (!marks[c] && (volume < target || meets_ball(mesh, c, center, radius_squared))) add(c);
    }
  }
  std::sort(patch.begin(), patch.end());
}

template void select_patch(const Mesh<2>&, std::span<const CellId>, const Vec<2>&, double, const LocalRelaxationOptions&,
                           Marks&, std::vector<CellId>&);
template void select_patch(const Mesh<3>&, std::span<const CellId>, const Vec<3>&, double, const LocalRelaxationOptions&,
                           Marks&, std::vector<CellId>&);

}  // namespace itr
