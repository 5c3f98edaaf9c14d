// SPDX-License-Identifier: MIT
#include "sizes.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "mesh/cell_of_facet.hpp"
#include "mesh/facet_measure.hpp"

namespace itr {

template <int Dim>
EdgeLengths edge_lengths(const Mesh<Dim>& mesh) {
  EdgeLengths lengths{.shortest = std::numeric_limits<double>::infinity()};
  for (const auto& [a, b] : mesh.edges()) {
    const double length = (mesh.rest(a) - mesh.rest(b)).norm();
    lengths.shortest = std::min(lengths.shortest, length);
    lengths.longest = std::max(lengths.longest, length);
  }
  return lengths;
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
  for (const FacetId f : mesh.live_facets()) sizes[mesh.body(cell_of_facet(mesh, f))].surface += facet_measure(mesh, f);
  for (auto& [body, size] : sizes) {
    size.diagonal = boxes[body].diagonal().norm();
    size.thickness = size.surface > 0 ? 2 * size.volume / size.surface : size.diagonal;
    const double of_cell = size.volume / cells[body];
    size.mean_edge = Dim == 2 ? std::sqrt(2 * of_cell) : std::cbrt(6 * std::sqrt(2.0) * of_cell);
  }
  return sizes;
}

template <int Dim>
std::vector<SmoothRidge<Dim>> smooth_ridges(const std::vector<std::array<int, Dim>>& facets,
                                            const std::function<Vec<Dim>(int v)>& at) {
  constexpr double kLargestTurn = 1.05;  // 60 degrees
  std::map<std::array<int, Dim - 1>, std::vector<int>> by_ridge;
  for (int f = 0; f < static_cast<int>(facets.size()); ++f)
    for (int left_out = 0; left_out < Dim; ++left_out) {
      std::array<int, Dim - 1> ridge;
      for (int i = 0; i < Dim - 1; ++i) ridge[i] = facets[f][(left_out + 1 + i) % Dim];
      std::sort(ridge.begin(), ridge.end());
      by_ridge[ridge].push_back(f);
    }
  // In 2D along the facet, which turns as the normal does; its length is twice the area in 3D.
  const auto normal_of = [&](int f) -> Vec<Dim> {
    const Vec<Dim> a = at(facets[f][1]) - at(facets[f][0]);
    if constexpr (Dim == 2)
      return a;
    else
      return a.cross(Vec<Dim>(at(facets[f][2]) - at(facets[f][0])));
  };
  std::vector<SmoothRidge<Dim>> ridges;
  for (const auto& [ridge, pair] : by_ridge) {
    if (pair.size() != 2) continue;
    const Vec<Dim> a = normal_of(pair[0]), b = normal_of(pair[1]);
    const double turn = std::acos(std::clamp(a.dot(b) / (a.norm() * b.norm()), -1.0, 1.0));
    if (turn > kLargestTurn) continue;
    const double length = Dim == 2 ? 1 : (at(ridge.front()) - at(ridge.back())).norm();
    ridges.push_back({{pair[0], pair[1]}, length, (a.norm() + b.norm()) / 2 / length, turn});
  }
  return ridges;
}

template <int Dim>
std::map<int, double> fractions_of_rounds(const Mesh<Dim>& mesh) {
  std::vector<FacetId> ids;
  std::vector<std::array<int, Dim>> facets;
  for (const FacetId f : mesh.live_facets()) {
    ids.push_back(f);
    facets.push_back(mesh.facet(f));
  }
  std::map<int, double> lost;
  for (const auto& ridge : smooth_ridges<Dim>(facets, [&](int v) { return mesh.rest(v); }))
    lost[mesh.body(cell_of_facet(mesh, ids[ridge.facets[0]]))] +=
        ridge.length * ridge.height * ridge.height * ridge.turn / 12;
  for (const auto& [body, size] : body_sizes(mesh)) lost[body] /= size.volume;
  return lost;
}

#define ITR_INSTANTIATE(Dim)                                                                          \
  template std::vector<SmoothRidge<Dim>> smooth_ridges<Dim>(const std::vector<std::array<int, Dim>>&, \
                                                            const std::function<Vec<Dim>(int)>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)
template std::map<int, double> fractions_of_rounds(const Mesh<2>&);
template std::map<int, double> fractions_of_rounds(const Mesh<3>&);
template EdgeLengths edge_lengths(const Mesh<2>&);
template EdgeLengths edge_lengths(const Mesh<3>&);
template std::map<int, BodySize> body_sizes(const Mesh<2>&);
template std::map<int, BodySize> body_sizes(const Mesh<3>&);

}  // namespace itr
