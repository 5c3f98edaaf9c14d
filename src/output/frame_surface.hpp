// SPDX-License-Identifier: MIT
// The surface of a stored frame as a certificate checks it: taken from the cells, not from what the frame says it is, since
// a certificate should trust as little as it can. Where a proxy touches in place of the boundary, it is the surface.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <string>
#include <vector>

#include "frame_file.hpp"
#include "geometry/bvh.hpp"
#include "geometry/closed_faces.hpp"

namespace itr::output {

template <int Dim>
std::vector<Vec<Dim>> points(const std::vector<double>& x) {
  std::vector<Vec<Dim>> result(x.size() / Dim);
  for (std::size_t v = 0; v < result.size(); ++v) result[v] = Eigen::Map<const Vec<Dim>>(x.data() + Dim * v);
  return result;
}

template <std::size_t N, std::size_t M>
int num_shared(const std::array<int, N>& a, const std::array<int, M>& b) {
  return static_cast<int>(
      std::count_if(a.begin(), a.end(), [&](int v) { return std::find(b.begin(), b.end(), v) != b.end(); }));
}

template <int Dim, std::size_t N>
std::vector<Box<Dim>> boxes_of(const std::vector<Vec<Dim>>& x, const std::vector<std::array<int, N>>& simplices) {
  std::vector<Box<Dim>> boxes(simplices.size());
  for (std::size_t i = 0; i < simplices.size(); ++i) {
    for (const int v : simplices[i]) boxes[i].include(x[v]);
  }
  return boxes;
}

/// The curved edges of a frame and their nodes.
struct CurvedNodes {
  int num_vertices;
  std::vector<EdgeKey> edges;  ///< ascending

  explicit CurvedNodes(const StoredFrame& frame)
      : num_vertices(static_cast<int>(frame.x.size()) / frame.dim - static_cast<int>(frame.curved_edges.size()) / 2) {
    for (std::size_t i = 0; i < frame.curved_edges.size(); i += 2)
      edges.push_back({static_cast<int>(frame.curved_edges[i]), static_cast<int>(frame.curved_edges[i + 1])});
  }
  int operator()(std::int64_t a, std::int64_t b) const {
    const EdgeKey edge = edge_key(static_cast<int>(a), static_cast<int>(b));
    const auto at = std::lower_bound(edges.begin(), edges.end(), edge);
    return at != edges.end() && *at == edge ? num_vertices + static_cast<int>(at - edges.begin()) : kNone;
  }
};

/// Vertices of bodies or of their proxy, then of obstacles, and the surface simplices on them.
template <int Dim>
struct FrameSurface {
  std::vector<Vec<Dim>> x;
  int num_body_vertices = 0;
  std::vector<EdgeKey> curved;  ///< edges whose nodes are the last of the bodies' vertices; empty with a proxy
  std::map<std::array<int, 2>, std::vector<int>> third_corners;  ///< 3D: by edge, of the bodies' facets beside it
  std::vector<std::array<int, Dim>> boundary;    ///< facets of the cells by corners, oriented outward; empty with a proxy
  std::vector<std::array<int, Dim>> own_facets;  ///< of bodies, oriented outward, or of the proxy, as they come
  bool has_proxy = false;
  const char* own = "";  ///< before the number of a vertex that is no obstacle's
  std::vector<std::array<int, 2>> edges;
  std::vector<std::array<int, 3>> triangles;  ///< 3D only
  ClosedFaces closed;

  /// Whether the two may lie on each other or overlap.
  template <std::size_t N, std::size_t M>
  bool excuses(const std::array<int, N>& a, const std::array<int, M>& b) const {
    return closed.excuse<Dim>(a, b, Eigen::Map<const VectorX>(x[0].data(), Dim * static_cast<Eigen::Index>(x.size())));
  }
  template <std::size_t N>
  bool is_obstacle(const std::array<int, N>& simplex) const {
    return simplex[0] >= num_body_vertices;
  }
  bool is_node(int v) const { return v >= num_body_vertices - static_cast<int>(curved.size()) && v < num_body_vertices; }
  /// The node of an edge between two vertices of bodies; kNone where it is straight.
  int node_of(int a, int b) const {
    const auto at = std::lower_bound(curved.begin(), curved.end(), edge_key(a, b));
    const int index = static_cast<int>(at - curved.begin()), count = static_cast<int>(curved.size());
    return index < count && *at == edge_key(a, b) ? num_body_vertices - count + index : kNone;
  }
  /// Corners of the facet or edge that a chord is a part of.
  template <std::size_t N>
  std::vector<int> corners_of(const std::array<int, N>& chord) const {
    std::vector<int> corners;
    for (const int v : chord) {
      const EdgeKey ends = is_node(v) ? curved[v - num_body_vertices + static_cast<int>(curved.size())] : EdgeKey{v, v};
      corners.insert(corners.end(), ends.begin(), ends.end());
    }
    std::sort(corners.begin(), corners.end());
    corners.erase(std::unique(corners.begin(), corners.end()), corners.end());
    return corners;
  }
  /// Whether the curves of two simplices, one of them with a node, are checked in their place: check_curves does so for
  /// facets that share no vertex. In 3D an edge is a part of each facet beside it.
  template <std::size_t N, std::size_t M>
  bool are_seen_as_curves(const std::array<int, N>& a, const std::array<int, M>& b) const {
    const auto has_node = [&](const auto& simplex) {
      return std::any_of(simplex.begin(), simplex.end(), [&](int v) { return is_node(v); });
    };
    if ((!has_node(a) && !has_node(b)) || closed.exclude<Dim>(a, b)) return false;
    const std::vector<int> of_a = corners_of(a), of_b = corners_of(b);
    const auto is_of_b = [&](int v) { return std::find(of_b.begin(), of_b.end(), v) != of_b.end(); };
    if (std::any_of(of_a.begin(), of_a.end(), is_of_b)) return false;
    if (Dim == 2 || of_a.size() > 2 || is_obstacle(a)) return true;
    const auto beside = third_corners.find({of_a[0], of_a[1]});
    return beside != third_corners.end() && !std::all_of(beside->second.begin(), beside->second.end(), is_of_b);
  }
  std::string name(int v) const {
    return v < num_body_vertices ? own + std::to_string(v) : fmt::format("obstacle {}", v - num_body_vertices);
  }
  template <std::size_t N>
  std::string name(const std::array<int, N>& simplex) const {
    std::string text = name(simplex[0]);
    for (std::size_t k = 1; k < N; ++k) text.append(", ").append(name(simplex[k]));
    return fmt::format("({})", text);
  }
};

inline const std::vector<std::array<int, 2>>& facets_of(const FrameSurface<2>& surface) { return surface.edges; }
inline const std::vector<std::array<int, 3>>& facets_of(const FrameSurface<3>& surface) { return surface.triangles; }

template <int Dim>
FrameSurface<Dim> make_surface(const StoredFrame& frame);

}  // namespace itr::output
