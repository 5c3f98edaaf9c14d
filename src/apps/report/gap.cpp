// SPDX-License-Identifier: MIT
#include "gap.hpp"

#include <algorithm>
#include <numeric>

#include "core/connected_parts.hpp"
#include "geometry/bvh.hpp"
#include "geometry/distance.hpp"

namespace itr::report {

namespace {

/// Numbers of the connected parts that nodes are in.
template <int Dim>
std::vector<int> parts_of(const StoredFrame& frame, int nodes) {
  std::vector<std::array<int, Dim + 1>> cells(frame.simplices.size() / (Dim + 1));
  for (std::size_t i = 0; i < frame.simplices.size(); ++i)
    cells[i / (Dim + 1)][i % (Dim + 1)] = static_cast<int>(frame.simplices[i]);
  std::vector<int> part = connected_parts<Dim + 1>(nodes, cells);
  const int num_curved = static_cast<int>(frame.curved_edges.size()) / 2;
  for (int e = 0; e < num_curved; ++e) part[nodes - num_curved + e] = part[frame.curved_edges[2 * e]];
  return part;
}

/// Facets; edges and points of obstacles are facets with equal corners.
template <int Dim>
struct Primitive {
  std::array<Vec<Dim>, Dim> corners;
  int part = -1;  ///< -1: of an obstacle
};

double squared_distance(const Vec<2>& p, const std::array<Vec<2>, 2>& to) {
  return point_edge_distance_squared<2>(p, to[0], to[1]);
}
double squared_distance(const Vec<3>& p, const std::array<Vec<3>, 3>& to) {
  return point_triangle_distance_squared(p, to[0], to[1], to[2]);
}

template <int Dim>
Vec<Dim> point(const std::vector<double>& x, std::int64_t i) {
  return Eigen::Map<const Vec<Dim>>(&x[static_cast<std::size_t>(i) * Dim]);
}

template <int Dim>
std::vector<double> gaps_in(const StoredFrame& frame, double most) {
  const int nodes = static_cast<int>(frame.x.size()) / Dim;
  const std::vector<int> part = parts_of<Dim>(frame, nodes);
  std::vector<Primitive<Dim>> primitives;
  const auto add = [&](const std::vector<double>& x, const std::vector<std::int64_t>& ids, int count, bool is_obstacle) {
    for (std::size_t i = 0; i + count <= ids.size(); i += count) {
      Primitive<Dim>& one = primitives.emplace_back();
      if (!is_obstacle) one.part = part[ids[i]];
      for (int k = 0; k < Dim; ++k) one.corners[k] = point<Dim>(x, ids[i + std::min(k, count - 1)]);
    }
  };
  add(frame.x, frame.surface, Dim, false);
  const auto& obstacles = frame.obstacles;
  add(obstacles.x, obstacles.faces, 3, true);
  add(obstacles.x, obstacles.edges, 2, true);
  std::vector<std::int64_t> points(obstacles.x.size() / Dim);
  std::iota(points.begin(), points.end(), 0);
  if (obstacles.faces.empty() && obstacles.edges.empty()) add(obstacles.x, points, 1, true);
  const bool is_alone = std::all_of(primitives.begin(), primitives.end(),
                                    [&](const auto& one) { return one.part >= 0 && one.part == primitives.front().part; });
  if (is_alone) return {};

  std::vector<Box<Dim>> boxes(primitives.size());
  for (std::size_t i = 0; i < primitives.size(); ++i)
    for (const Vec<Dim>& corner : primitives[i].corners) boxes[i].include(corner);
  const Bvh<Dim> tree(boxes);
  std::vector<char> is_outside(nodes, 0);
  for (const std::int64_t v : frame.surface) is_outside[v] = 1;
  const int num_curved = static_cast<int>(frame.curved_edges.size()) / 2;
  for (int e = 0; e < num_curved; ++e)
    is_outside[nodes - num_curved + e] = is_outside[frame.curved_edges[2 * e]] && is_outside[frame.curved_edges[2 * e + 1]];
  std::vector<double> found(nodes, most);
  std::vector<int> hits;
  for (int i = 0; i < nodes; ++i) {
    if (!is_outside[i]) continue;
    const Vec<Dim> p = point<Dim>(frame.x, i);
    Box<Dim> box;
    box.include(p);
    hits.clear();
    tree.query(box.inflated(most), hits);
    double least = most * most;
    for (const int hit : hits) {
      const Primitive<Dim>& one = primitives[hit];
      if (one.part != part[i]) least = std::min(least, squared_distance(p, one.corners));
    }
    found[i] = std::sqrt(least);
  }
  return found;
}

}  // namespace

std::vector<double> gaps(const StoredFrame& frame, double most) {
  return frame.dim == 2 ? gaps_in<2>(frame, most) : gaps_in<3>(frame, most);
}

}  // namespace itr::report
