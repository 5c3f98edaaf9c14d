// SPDX-License-Identifier: MIT
#include "energy/contact/surface.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <numbers>
#include <utility>

#include "itr/contact.hpp"
#include "mesh/validate.hpp"

namespace itr {

namespace {

/// Lists of `second` by `first` < n, each in the order in which `visit` calls what it is given with pairs of them. What is
/// made here is made in the memory of what was there.
template <typename Visit>
void group(int n, const Visit& visit, Adjacency& result) {
  result.offset.assign(n + 2, 0);
  visit([&](int first, int) { ++result.offset[first + 2]; });
  for (int i = 2; i < n + 2; ++i) result.offset[i] += result.offset[i - 1];
  result.id.resize(result.offset.back());
  visit([&](int first, int second) { result.id[result.offset[first + 1]++] = second; });
  result.offset.pop_back();
}

std::array<int, 2> edge_between(int a, int b) { return {std::min(a, b), std::max(a, b)}; }

/// Lists those of the triangles too, each edge once, ascending.
void sort_edges(CollisionSurface& surface) {
  auto& edges = surface.edges;
  for (auto& [a, b] : edges)
    if (a > b) std::swap(a, b);
  for (const auto& [a, b, c] : surface.triangles)
    edges.insert(edges.end(), {edge_between(a, b), edge_between(b, c), edge_between(c, a)});
  const auto key = [](const std::array<int, 2>& e) { return static_cast<std::int64_t>(e[0]) << 32 | e[1]; };
  std::sort(edges.begin(), edges.end(), [&](const auto& e, const auto& f) { return key(e) < key(f); });
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
}

/// The edges of triangles and of vertices.
void add_neighbours(int num_vertices, CollisionSurface& surface) {
  const auto& edges = surface.edges;
  const auto visit_ends = [&](const auto& add) {
    for (int e = 0; e < static_cast<int>(edges.size()); ++e)
      for (const int v : edges[e]) add(v, e);
  };
  group(num_vertices, visit_ends, surface.vertex_edges);
  surface.triangle_edges.resize(surface.triangles.size());
  for (std::size_t i = 0; i < surface.triangles.size(); ++i)
    for (int k = 0; k < 3; ++k) {
      const auto edge = edge_between(surface.triangles[i][k], surface.triangles[i][(k + 1) % 3]);
      const auto at_first = surface.vertex_edges[edge[0]];
      surface.triangle_edges[i][k] =
          *std::find_if(at_first.begin(), at_first.end(), [&](int e) { return edges[e] == edge; });
    }
}

void add_topology_of_triangles(std::span<const Vec<3>> rest, CollisionSurface& surface) {
  const auto& edges = surface.edges;
  const std::size_t num_vertices = rest.size();
  add_neighbours(static_cast<int>(num_vertices), surface);
  auto& has_triangles = surface.on_open_boundary;  // until that is known
  has_triangles.assign(num_vertices, 0);
  surface.edge_area.assign(edges.size(), 0);
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    const auto& triangle = surface.triangles[i];
    const Vec<3>&a = rest[triangle[0]], &b = rest[triangle[1]], &c = rest[triangle[2]];
    const double third = (b - a).cross(c - a).norm() / 6;
    for (int k = 0; k < 3; ++k) {
      surface.edge_area[surface.triangle_edges[i][k]] += third;
      if (third == 0) continue;
      double& area = surface.area[triangle[k]];
      area = std::exchange(has_triangles[triangle[k]], 1) ? area + third : third;
    }
  }
  const auto visit_opposites = [&](const auto& add) {
    for (std::size_t i = 0; i < surface.triangles.size(); ++i)
      for (int k = 0; k < 3; ++k) add(surface.triangle_edges[i][k], surface.triangles[i][(k + 2) % 3]);
  };
  group(static_cast<int>(edges.size()), visit_opposites, surface.edge_opposites);
  surface.on_open_boundary.assign(num_vertices, 0);
  surface.edge_length_squared.clear();
  for (int e = 0; e < static_cast<int>(edges.size()); ++e) {
    const auto [a, b] = edges[e];
    const double length_squared = (rest[a] - rest[b]).squaredNorm();
    surface.edge_length_squared.push_back(length_squared);
    if (surface.edge_opposites[e].empty()) surface.edge_area[e] = std::sqrt(length_squared);
    if (surface.edge_opposites[e].size() == 1) surface.on_open_boundary[a] = surface.on_open_boundary[b] = 1;
  }
}

/// The mean of 2 pi R over an edge with the weight that falls linearly from one end to the other; of a plane beyond the axis
/// nothing.
double turn_at(double R, double other_end) { return std::max(0.0, 2 * std::numbers::pi * (2 * R + other_end) / 3); }

}  // namespace

template <int Dim>
void complete_collision_surface(CollisionSurface& surface, std::span<const int> points, std::span<const Vec<Dim>> rest) {
  ++surface.revision;
  const auto is_on_axis = [&](const std::array<int, 2>& edge) { return rest[edge[0]][0] == 0 && rest[edge[1]][0] == 0; };
  if (surface.axisymmetric) std::erase_if(surface.edges, is_on_axis);
  sort_edges(surface);
  surface.area.assign(rest.size(), 0);
  surface.degree.assign(rest.size(), 0);
  for (const auto& [a, b] : surface.edges) {
    const double half = (rest[b] - rest[a]).norm() / 2;
    for (const int v : {a, b}) {
      surface.area[v] += surface.axisymmetric ? half * turn_at(rest[v][0], rest[v == a ? b : a][0]) : half;
      ++surface.degree[v];
    }
  }
  for (const int v : points)
    if (surface.degree[v] == 0) surface.area[v] = 1;
  surface.vertices.clear();
  for (int v = 0; v < static_cast<int>(rest.size()); ++v)
    if (surface.degree[v] > 0 || surface.area[v] > 0) surface.vertices.push_back(v);
  if constexpr (Dim == 3) add_topology_of_triangles(rest, surface);
}

template <int Dim>
CollisionSurface make_collision_surface(std::vector<std::array<int, 2>> edges, std::vector<std::array<int, 3>> triangles,
                                        std::span<const int> points, std::span<const Vec<Dim>> rest,
                                        std::vector<char> counts, bool axisymmetric) {
  CollisionSurface surface;
  surface.axisymmetric = axisymmetric;
  surface.edges = std::move(edges);
  surface.triangles = std::move(triangles);
  surface.counts = std::move(counts);
  complete_collision_surface(surface, points, rest);
  return surface;
}

template <int Dim>
std::shared_ptr<const CollisionSurface> collision_surface(std::vector<std::array<int, 2>> edges,
                                                          std::vector<std::array<int, 3>> triangles,
                                                          std::span<const int> points, std::span<const Vec<Dim>> rest,
                                                          std::vector<char> counts) {
  return std::make_shared<const CollisionSurface>(
      make_collision_surface(std::move(edges), std::move(triangles), points, rest, std::move(counts)));
}

template <>
std::vector<std::array<int, 2>> find_intersections<2>(const CollisionSurface& surface, ConstVectorView x, std::size_t most) {
  return find_intersections(x, surface.edges, surface.counts, most, surface.closed);
}
template <>
std::vector<std::array<int, 2>> find_intersections<3>(const CollisionSurface& surface, ConstVectorView x, std::size_t most) {
  return find_intersections(x, surface.edges, surface.triangles, surface.counts, most, surface.closed);
}

#define ITR_INSTANTIATE(Dim)                                                                                                \
  template void complete_collision_surface<Dim>(CollisionSurface&, std::span<const int>, std::span<const Vec<Dim>>);        \
  template CollisionSurface make_collision_surface<Dim>(std::vector<std::array<int, 2>>, std::vector<std::array<int, 3>>,   \
                                                        std::span<const int>, std::span<const Vec<Dim>>, std::vector<char>, \
                                                        bool);                                                              \
  template std::shared_ptr<const CollisionSurface> collision_surface<Dim>(                                                  \
      std::vector<std::array<int, 2>>, std::vector<std::array<int, 3>>, std::span<const int>, std::span<const Vec<Dim>>,    \
      std::vector<char>);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
