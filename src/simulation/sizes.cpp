// SPDX-License-Identifier: MIT
#include "sizes.hpp"

#include <Eigen/Geometry>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "mesh/cell_of_facet.hpp"

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
std::map<int, double> fractions_of_rounds(const Mesh<Dim>& mesh) {
  constexpr double kLargestTurn = 1.05;  // 60 degrees
  std::map<std::array<int, Dim - 1>, std::vector<FacetId>> corners;
  for (const FacetId f : mesh.live_facets())
    for (int left_out = 0; left_out < Dim; ++left_out) {
      std::array<int, Dim - 1> corner;
      for (int i = 0; i < Dim - 1; ++i) corner[i] = mesh.facet(f)[(left_out + 1 + i) % Dim];
      std::sort(corner.begin(), corner.end());
      corners[corner].push_back(f);
    }
  // In 2D along the facet, which turns as the normal does; its length is twice the area in 3D.
  const auto normal_of = [&](FacetId f) -> Vec<Dim> {
    const auto& facet = mesh.facet(f);
    const Vec<Dim> a = mesh.rest(facet[1]) - mesh.rest(facet[0]);
    if constexpr (Dim == 2)
      return a;
    else
      return a.cross(Vec<Dim>(mesh.rest(facet[2]) - mesh.rest(facet[0])));
  };
  std::map<int, double> lost;
  for (const auto& [corner, facets] : corners) {
    if (facets.size() != 2) continue;
    const Vec<Dim> a = normal_of(facets[0]), b = normal_of(facets[1]);
    const double turn = std::acos(std::clamp(a.dot(b) / (a.norm() * b.norm()), -1.0, 1.0));
    if (turn > kLargestTurn) continue;
    const double length = Dim == 2 ? 1 : (mesh.rest(corner.front()) - mesh.rest(corner.back())).norm();
    const double height = (a.norm() + b.norm()) / 2 / length;  // of the facets above the corner
    lost[mesh.body(cell_of_facet(mesh, facets[0]))] += length * height * height * turn / 12;
  }
  for (const auto& [body, size] : body_sizes(mesh)) lost[body] /= size.volume;
  return lost;
}

template std::map<int, double> fractions_of_rounds(const Mesh<2>&);
template std::map<int, double> fractions_of_rounds(const Mesh<3>&);
template EdgeLengths edge_lengths(const Mesh<2>&);
template EdgeLengths edge_lengths(const Mesh<3>&);
template double facet_measure(const Mesh<2>&, FacetId);
template double facet_measure(const Mesh<3>&, FacetId);
template std::map<int, BodySize> body_sizes(const Mesh<2>&);
template std::map<int, BodySize> body_sizes(const Mesh<3>&);

}  // namespace itr
