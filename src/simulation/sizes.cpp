// SPDX-License-Identifier: MIT
#include "sizes.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace itr {

namespace {

template <int Dim>
int body_at(const Mesh<Dim>& mesh, const typename Mesh<Dim>::Facet& facet) {
  for (const CellId c : mesh.cells_of(facet[0])) {
    const auto& cell = mesh.cell(c);
    const auto has = [&](int v) { return std::find(cell.begin(), cell.end(), v) != cell.end(); };
    if (std::all_of(facet.begin(), facet.end(), has)) return mesh.body(c);
  }
  return mesh.body(mesh.cells_of(facet[0]).front());
}

}  // namespace

template <int Dim>
double facet_measure(const Mesh<Dim>& mesh, FacetId f) {
  const auto& facet = mesh.facet(f);
  const Vec<Dim> a = mesh.rest(facet[1]) - mesh.rest(facet[0]);
  if constexpr (Dim == 2) {
    return a.norm();
  } else {
    return a.cross(Vec<Dim>(mesh.rest(facet[2]) - mesh.rest(facet[0]))).norm() / 2;
  }
}

template <int Dim>
std::map<int, BodySize> body_sizes(const Mesh<Dim>& mesh) {
  std::map<int, BodySize> sizes;
  std::map<int, Eigen::AlignedBox<double, Dim>> boxes;
  std::map<int, int> cells;
  for (const CellId c : mesh.live_cells()) {
    sizes[mesh.body(c)].volume += mesh.volume(c);
    ++cells[mesh.body(c)];
    for (const int v : mesh.cell(c)) boxes[mesh.body(c)].extend(mesh.rest(v));
  }
  for (const FacetId f : mesh.live_facets()) sizes[body_at<Dim>(mesh, mesh.facet(f))].surface += facet_measure(mesh, f);
  for (auto& [body, size] : sizes) {
    size.diagonal = boxes[body].diagonal().norm();
    size.thickness = size.surface > 0 ? 2 * size.volume / size.surface : size.diagonal;
    const double of_cell = size.volume / cells[body];
    size.mean_edge = Dim == 2 ? std::sqrt(2 * of_cell) : std::cbrt(6 * std::sqrt(2.0) * of_cell);
  }
  return sizes;
}

template double facet_measure(const Mesh<2>&, FacetId);
template double facet_measure(const Mesh<3>&, FacetId);
template std::map<int, BodySize> body_sizes(const Mesh<2>&);
template std::map<int, BodySize> body_sizes(const Mesh<3>&);

}  // namespace itr
