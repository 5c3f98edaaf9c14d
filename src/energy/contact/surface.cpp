// SPDX-License-Identifier: MIT
#include "itr/energy/contact/surface.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cstdint>
#include <utility>

#include "itr/mesh/validate.hpp"

namespace itr {

namespace {

/// Lists of `second` by `first` < n, each in the order of the pairs.
Adjacency group(int n, const std::vector<std::array<int, 2>>& pairs) {
  Adjacency result;
  result.offset.assign(n + 1, 0);
  for (const auto& [first, second] : pairs) ++result.offset[first + 1];
  for (int i = 0; i < n; ++i) result.offset[i + 1] += result.offset[i];
  result.id.resize(pairs.size());
  std::vector<int> next(result.offset.begin(), result.offset.end() - 1);
  for (const auto& [first, second] : pairs) result.id[next[first]++] = second;
  return result;
}

/// Lists those of the triangles too, each edge once, ascending; says which are a triangle's.
void sort_edges(CollisionSurface& surface) {
  struct Side {
    std::uint64_t edge;  ///< smaller vertex, then the other
    std::size_t number;  ///< 3 * triangle + k; behind all of these where it is of none
  };
  std::vector<Side> sides;
  sides.reserve(surface.edges.size() + 3 * surface.triangles.size());
  const auto add = [&](int a, int b, std::size_t number) {
    sides.push_back({static_cast<std::uint64_t>(std::min(a, b)) << 32 | static_cast<std::uint64_t>(std::max(a, b)), number});
  };
  const std::size_t of_none = 3 * surface.triangles.size();
  for (const auto& [a, b] : surface.edges) add(a, b, of_none);
  for (std::size_t i = 0; i < of_none; ++i) add(surface.triangles[i / 3][i % 3], surface.triangles[i / 3][(i + 1) % 3], i);
  std::sort(sides.begin(), sides.end(), [](const Side& a, const Side& b) { return a.edge < b.edge; });
  surface.edges.clear();
  surface.triangle_edges.resize(surface.triangles.size());
  for (std::size_t i = 0; i < sides.size(); ++i) {
    const auto [edge, number] = sides[i];
    if (i == 0 || edge != sides[i - 1].edge)
      surface.edges.push_back({static_cast<int>(edge >> 32), static_cast<int>(edge & 0xffffffff)});
    if (number < of_none) surface.triangle_edges[number / 3][number % 3] = static_cast<int>(surface.edges.size()) - 1;
  }
}

void add_topology_of_triangles(std::span<const Vec<3>> rest, CollisionSurface& surface) {
  const int num_edges = static_cast<int>(surface.edges.size()), num_vertices = static_cast<int>(rest.size());
  std::vector<std::array<int, 2>> opposites, star;
  std::vector<double> triangle_area(num_vertices, 0);
  opposites.reserve(3 * surface.triangles.size());
  star.reserve(2 * surface.edges.size());
  surface.edge_area.assign(num_edges, 0);
  for (std::size_t i = 0; i < surface.triangles.size(); ++i) {
    const auto &triangle = surface.triangles[i], &edges = surface.triangle_edges[i];
    const Vec<3>&a = rest[triangle[0]], &b = rest[triangle[1]], &c = rest[triangle[2]];
    const double third = (b - a).cross(c - a).norm() / 6;
    for (int k = 0; k < 3; ++k) {
      opposites.push_back({edges[k], triangle[(k + 2) % 3]});
      surface.edge_area[edges[k]] += third;
      triangle_area[triangle[k]] += third;
    }
  }
  for (int v = 0; v < num_vertices; ++v)
    if (triangle_area[v] > 0) surface.area[v] = triangle_area[v];
  surface.edge_opposites = group(num_edges, opposites);
  surface.on_open_boundary.assign(num_vertices, 0);
  for (int e = 0; e < num_edges; ++e) {
    const auto [a, b] = surface.edges[e];
    const double length_squared = (rest[a] - rest[b]).squaredNorm();
    surface.edge_length_squared.push_back(length_squared);
    if (surface.edge_opposites[e].empty()) surface.edge_area[e] = std::sqrt(length_squared);
    if (surface.edge_opposites[e].size() == 1) surface.on_open_boundary[a] = surface.on_open_boundary[b] = 1;
    star.push_back({a, e});
    star.push_back({b, e});
  }
  surface.vertex_edges = group(num_vertices, star);
}

}  // namespace

template <int Dim>
CollisionSurface make_collision_surface(std::vector<std::array<int, 2>> edges, std::vector<std::array<int, 3>> triangles,
                                        std::span<const int> points, std::span<const Vec<Dim>> rest,
                                        std::vector<char> counts) {
  CollisionSurface surface;
  surface.edges = std::move(edges);
  surface.triangles = std::move(triangles);
  surface.counts = std::move(counts);
  sort_edges(surface);

  surface.area.assign(rest.size(), 0);
  surface.degree.assign(rest.size(), 0);
  for (const auto& [a, b] : surface.edges) {
    const double half = (rest[b] - rest[a]).norm() / 2;
    for (const int v : {a, b}) {
      surface.area[v] += half;
      ++surface.degree[v];
    }
  }
  std::vector<char> is_point(rest.size(), 0);
  for (const int v : points) is_point[v] = 1;
  for (int v = 0; v < static_cast<int>(rest.size()); ++v) {
    if (surface.degree[v] == 0 && !is_point[v]) continue;
    surface.vertices.push_back(v);
    if (surface.degree[v] == 0) surface.area[v] = 1;
  }
  if constexpr (Dim == 3) add_topology_of_triangles(rest, surface);
  return surface;
}

template <>
std::vector<std::array<int, 2>> find_intersections<2>(const CollisionSurface& surface, ConstVectorView x, std::size_t most) {
  return find_intersections(x, surface.edges, surface.counts, most);
}
template <>
std::vector<std::array<int, 2>> find_intersections<3>(const CollisionSurface& surface, ConstVectorView x, std::size_t most) {
  return find_intersections(x, surface.edges, surface.triangles, surface.counts, most);
}

template CollisionSurface make_collision_surface<2>(std::vector<std::array<int, 2>>, std::vector<std::array<int, 3>>,
                                                    std::span<const int>, std::span<const Vec<2>>, std::vector<char>);
template CollisionSurface make_collision_surface<3>(std::vector<std::array<int, 2>>, std::vector<std::array<int, 3>>,
                                                    std::span<const int>, std::span<const Vec<3>>, std::vector<char>);

}  // namespace itr
