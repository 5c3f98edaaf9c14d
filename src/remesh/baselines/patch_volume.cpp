// SPDX-License-Identifier: MIT
#include "patch_volume.hpp"

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
void grow_to_volume(const Mesh<Dim>& mesh, const Edit<Dim>& edit, double target, Marks& marks, std::vector<CellId>& patch) {
  const Vec<Dim> center =
      edit.value ? edit.value->rest : Vec<Dim>(0.5 * (mesh.rest(edit.edge[0]) + mesh.rest(edit.edge[1])));
  const double radius_squared = radius_squared_of<Dim>(target);
  double volume = 0;
  for (const CellId c : patch) volume += mesh.volume(c);
  for (std::size_t i = 0; i < patch.size(); ++i) {
    const auto cell = mesh.cell(patch[i]);
    for (const int v : cell)
      for (const CellId c : mesh.cells_of(v))
        if (!marks[c] && (volume < target || meets_ball(mesh, c, center, radius_squared))) {
          marks.mark(c);
          patch.push_back(c);
          volume += mesh.volume(c);
        }
  }
}

template void grow_to_volume(const Mesh<2>&, const Edit<2>&, double, Marks&, std::vector<CellId>&);
template void grow_to_volume(const Mesh<3>&, const Edit<3>&, double, Marks&, std::vector<CellId>&);

}  // namespace itr
