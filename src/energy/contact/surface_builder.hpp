// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "energy/contact/surface.hpp"

namespace itr {

/// Calls f(ids) for each edge, triangle and vertex of obstacles or of a proxy, whose vertices have ids from `first` on.
template <typename Surface, typename F>
void for_each_simplex(const Surface& surface, int first, const F& f) {
  for (const auto& [a, b] : surface.edges) f(std::array{first + a, first + b});
  for (const auto& [a, b, c] : surface.triangles) f(std::array{first + a, first + b, first + c});
  for (int v = 0; v < static_cast<int>(surface.rest.size()); ++v) f(std::array{first + v});
}

/// Collects points, edges and triangles, and makes a CollisionSurface of them.
template <int Dim>
class SurfaceBuilder {
 public:
  explicit SurfaceBuilder(bool axisymmetric) : axisymmetric_(axisymmetric) {}
  template <std::size_t N>
  void add(const std::array<int, N>& simplex) {
    if constexpr (N == 1) points_.push_back(simplex[0]);
    if constexpr (N == 2) edges_.push_back(simplex);
    if constexpr (N == 3) triangles_.push_back(simplex);
  }
  CollisionSurface build(const std::vector<Vec<Dim>>& rest, std::vector<char> counts) {
    return make_collision_surface<Dim>(std::move(edges_), std::move(triangles_), points_, rest, std::move(counts),
                                       axisymmetric_);
  }
  /// Adds the obstacles, whose vertices follow those of `rest` and do not count.
  template <typename Obstacles>
  CollisionSurface build(std::vector<Vec<Dim>> rest, std::vector<char> counts, const Obstacles& obstacles) {
    for_each_simplex(obstacles, static_cast<int>(rest.size()), [&](const auto& ids) { add(ids); });
    rest.insert(rest.end(), obstacles.rest.begin(), obstacles.rest.end());
    counts.resize(rest.size(), 0);
    return build(rest, std::move(counts));
  }

 private:
  bool axisymmetric_;
  std::vector<std::array<int, 2>> edges_;
  std::vector<std::array<int, 3>> triangles_;
  std::vector<int> points_;
};

/// The surface of bodies by facets between their vertices, of which those of facets count, and of obstacles.
template <int Dim, typename Obstacles>
CollisionSurface surface_of_facets(const std::vector<std::array<int, Dim>>& facets, std::vector<Vec<Dim>> rest,
                                   const Obstacles& obstacles, bool axisymmetric) {
  SurfaceBuilder<Dim> builder(axisymmetric);
  std::vector<char> counts(rest.size(), 0);
  for (const auto& facet : facets) {
    builder.add(facet);
    for (const int v : facet) counts[v] = 1;
  }
  return builder.build(std::move(rest), std::move(counts), obstacles);
}

}  // namespace itr
