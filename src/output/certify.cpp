// SPDX-License-Identifier: MIT
// The surface is taken from the cells, not from what the frame says it is: a certificate should trust as little as it can.
// Where a proxy touches in place of the boundary, it is the surface. Obstacles are prescribed, so two of them may cross each
// other; anything else that shares a point without sharing a vertex is a violation, and so are neighbours that lie on each
// other. What is wholly inside is found by winding numbers.
#include "output/certify.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "fem/chords.hpp"
#include "frame_file.hpp"
#include "geometry/bvh.hpp"
#include "geometry/closed_surface.hpp"
#include "geometry/predicates.hpp"
#include "geometry/quadratic_patch.hpp"
#include "itr/core/error.hpp"
#include "itr/fem/quadratic.hpp"
#include "itr/geometry/distance.hpp"
#include "itr/geometry/quadratic_validity.hpp"

namespace itr::output {

namespace {

namespace fs = std::filesystem;
using Of = Violation::Of;

template <std::size_t N, std::size_t M>
int num_shared(const std::array<int, N>& a, const std::array<int, M>& b) {
  return static_cast<int>(
      std::count_if(a.begin(), a.end(), [&](int v) { return std::find(b.begin(), b.end(), v) != b.end(); }));
}

/// Vertices of bodies or of their proxy, then of obstacles, and the surface simplices on them.
template <int Dim>
struct Surface {
  std::vector<Vec<Dim>> x;
  int num_body_vertices = 0;
  std::vector<EdgeKey> curved;  ///< edges whose nodes are the last of the bodies' vertices; empty with a proxy
  std::map<std::array<int, 2>, std::vector<int>> third_corners;  ///< 3D: by edge, of the bodies' facets beside it
  std::vector<std::array<int, Dim>> own_facets;  ///< of bodies, oriented outward, or of the proxy, as they come
  bool has_proxy = false;
  const char* own = "";  ///< before the number of a vertex that is no obstacle's
  std::vector<std::array<int, 2>> edges;
  std::vector<std::array<int, 3>> triangles;  ///< 3D only

  template <std::size_t N>
  bool is_obstacle(const std::array<int, N>& simplex) const {
    return simplex[0] >= num_body_vertices;
  }
  bool is_node(int v) const { return v >= num_body_vertices - static_cast<int>(curved.size()) && v < num_body_vertices; }
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
    if (!has_node(a) && !has_node(b)) return false;
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

template <int Dim>
std::vector<Vec<Dim>> points(const std::vector<double>& x) {
  std::vector<Vec<Dim>> result(x.size() / Dim);
  for (std::size_t v = 0; v < result.size(); ++v) result[v] = Eigen::Map<const Vec<Dim>>(x.data() + Dim * v);
  return result;
}

/// Facets with one incident cell, oriented outward.
template <int Dim>
std::vector<std::array<int, Dim>> boundary_facets(const std::vector<std::int64_t>& simplices) {
  using Facet = std::array<int, Dim>;
  std::vector<std::pair<Facet, Facet>> facets;  // sorted, oriented
  facets.reserve(simplices.size());
  for (std::size_t c = 0; c < simplices.size(); c += Dim + 1) {
    for (int skipped = 0; skipped <= Dim; ++skipped) {
      Facet facet;
      for (int k = 0, i = 0; k <= Dim; ++k) {
        if (k != skipped) facet[i++] = static_cast<int>(simplices[c + k]);
      }
      Facet oriented = facet;
      if (skipped % 2 == 1) std::swap(oriented[0], oriented[1]);
      std::sort(facet.begin(), facet.end());
      facets.emplace_back(facet, oriented);
    }
  }
  std::sort(facets.begin(), facets.end());
  std::vector<Facet> once;
  for (std::size_t i = 0, j = 0; i < facets.size(); i = j) {
    while (j < facets.size() && facets[j].first == facets[i].first) ++j;
    if (j == i + 1) once.push_back(facets[i].second);
  }
  return once;
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

/// The surface through all nodes.
template <int Dim>
std::vector<std::array<int, Dim>> chords(const std::vector<std::array<int, Dim>>& facets, const CurvedNodes& node_of) {
  std::vector<std::array<int, Dim>> result;
  for (const auto& facet : facets) for_each_chord<Dim>(facet, node_of, [&](const auto& ids) { result.push_back(ids); });
  return result;
}

/// Facets as what can intersect, where orientation does not matter.
void add_facets(const std::vector<std::array<int, 2>>& facets, Surface<2>& surface) { surface.edges = facets; }

void add_facets(const std::vector<std::array<int, 3>>& facets, Surface<3>& surface) {
  surface.triangles = facets;
  for (const auto& f : facets) surface.edges.insert(surface.edges.end(), {{f[0], f[1]}, {f[0], f[2]}, {f[1], f[2]}});
  std::sort(surface.edges.begin(), surface.edges.end());
  surface.edges.erase(std::unique(surface.edges.begin(), surface.edges.end()), surface.edges.end());
}

template <int Dim>
void add_surface(const StoredSurface& stored, Surface<Dim>& surface) {
  const int offset = static_cast<int>(surface.x.size());
  const std::vector<Vec<Dim>> x = points<Dim>(stored.x);
  surface.x.insert(surface.x.end(), x.begin(), x.end());
  const auto& edges = stored.edges;
  for (std::size_t i = 0; i < edges.size(); i += 2) {
    surface.edges.push_back({offset + static_cast<int>(edges[i]), offset + static_cast<int>(edges[i + 1])});
  }
  const auto& faces = stored.faces;
  for (std::size_t i = 0; i < faces.size(); i += 3) {
    surface.triangles.push_back({offset + static_cast<int>(faces[i]), offset + static_cast<int>(faces[i + 1]),
                                 offset + static_cast<int>(faces[i + 2])});
  }
}

const std::vector<std::array<int, 2>>& facets_of(const Surface<2>& surface) { return surface.edges; }
const std::vector<std::array<int, 3>>& facets_of(const Surface<3>& surface) { return surface.triangles; }

template <int Dim>
Surface<Dim> make_surface(const StoredFrame& frame) {
  Surface<Dim> surface;
  surface.has_proxy = frame.has_proxy;
  if (frame.has_proxy) {
    surface.own = "proxy ";
    add_surface(frame.proxy, surface);
    surface.own_facets = facets_of(surface);
  } else {
    surface.x = points<Dim>(frame.x);
    const auto boundary = boundary_facets<Dim>(frame.simplices);
    surface.own_facets = chords<Dim>(boundary, CurvedNodes(frame));
    if constexpr (Dim == 3)
      for (const auto& f : boundary)
        for (int k = 0; k < 3; ++k) {
          const auto [first, last] = std::minmax(f[k], f[(k + 1) % 3]);
          surface.third_corners[{first, last}].push_back(f[(k + 2) % 3]);
        }
    auto facets = surface.own_facets;
    for (auto& facet : facets) std::sort(facet.begin(), facet.end());
    add_facets(facets, surface);
  }
  surface.num_body_vertices = static_cast<int>(surface.x.size());
  if (!frame.has_proxy) surface.curved = CurvedNodes(frame).edges;
  add_surface(frame.obstacles, surface);
  return surface;
}

int orientation_of(const std::array<Vec<2>, 3>& p) { return orientation(p[0], p[1], p[2]); }
int orientation_of(const std::array<Vec<3>, 4>& p) { return orientation(p[0], p[1], p[2], p[3]); }

/// Positions of all nodes of a cell with a curved edge; nothing where all of its edges are straight.
template <int Dim>
std::optional<QuadraticCell<Dim>> curved_cell(const StoredFrame& frame, std::size_t c, const std::vector<Vec<Dim>>& x,
                                              const CurvedNodes& node_of) {
  const std::int64_t* cell = &frame.simplices[(Dim + 1) * c];
  QuadraticCell<Dim> nodes;
  bool is_curved = false;
  for (int k = 0; k <= Dim; ++k) nodes.col(k) = x[cell[k]];
  for_each_edge<Dim>([&](int edge, int i, int j) {
    const int node = node_of(cell[i], cell[j]);
    is_curved = is_curved || node != kNone;
    nodes.col(Dim + 1 + edge) = node != kNone ? x[node] : Vec<Dim>((x[cell[i]] + x[cell[j]]) / 2);
  });
  return is_curved ? std::optional(nodes) : std::nullopt;
}

/// `what`: of the cells, where `coordinates` say that their vertices are.
template <int Dim>
void check_cells(const StoredFrame& frame, const std::vector<double>& coordinates, const char* what, const std::string& name,
                 std::vector<Violation>& violations) {
  const std::vector<Vec<Dim>> x = points<Dim>(coordinates);
  const CurvedNodes node_of(frame);
  for (std::size_t c = 0; c < frame.simplices.size() / (Dim + 1); ++c) {
    std::array<Vec<Dim>, Dim + 1> p;
    for (int k = 0; k <= Dim; ++k) p[k] = x[frame.simplices[(Dim + 1) * c + k]];
    if (const auto nodes = curved_cell<Dim>(frame, c, x, node_of)) {
      if (!is_positive_everywhere_exact<Dim>(*nodes))
        violations.push_back({Of::cells, fmt::format("{}: {}cell {} is not positive everywhere", name, what, c)});
      continue;
    }
    const int sign = orientation_of(p);
    if (sign <= 0)
      violations.push_back(
          {Of::cells, fmt::format("{}: {}cell {} is {}", name, what, c, sign < 0 ? "inverted" : "degenerate")});
  }
}

template <int Dim, std::size_t N>
std::vector<Box<Dim>> boxes_of(const std::vector<Vec<Dim>>& x, const std::vector<std::array<int, N>>& simplices) {
  std::vector<Box<Dim>> boxes(simplices.size());
  for (std::size_t i = 0; i < simplices.size(); ++i) {
    for (const int v : simplices[i]) boxes[i].include(x[v]);
  }
  return boxes;
}

/// Whether an edge and a triangle with one common vertex lie on each other: in one plane, and the edge within the triangle's
/// angle at that vertex. Exact.
bool is_folded(const Surface<3>& surface, const std::array<int, 2>& edge, const std::array<int, 3>& triangle) {
  const int corner =
      static_cast<int>(std::find_first_of(triangle.begin(), triangle.end(), edge.begin(), edge.end()) - triangle.begin());
  const Vec<3>&o = surface.x[triangle[corner]], &a = surface.x[triangle[(corner + 1) % 3]],
        &b = surface.x[triangle[(corner + 2) % 3]], &end = surface.x[edge[edge[0] == triangle[corner] ? 1 : 0]];
  if (orientation(o, a, b, end) != 0) return false;
  for (int axis = 0; axis < 3; ++axis) {  // a plane of two axes on which the triangle's shadow has an area
    const auto shadow = [axis](const Vec<3>& p) { return Vec<2>(p[(axis + 1) % 3], p[(axis + 2) % 3]); };
    const int turn = orientation(shadow(o), shadow(a), shadow(b));
    if (turn == 0) continue;
    return turn * orientation(shadow(o), shadow(a), shadow(end)) >= 0 &&
           turn * orientation(shadow(o), shadow(end), shadow(b)) >= 0;
  }
  return false;
}

/// Whether two edges with one common vertex lie on each other: in one line, and to the same side of that vertex. Exact.
bool is_folded(const Surface<2>& surface, const std::array<int, 2>& a, const std::array<int, 2>& b) {
  const int common = a[0] == b[0] || a[0] == b[1] ? a[0] : a[1];
  const Vec<2>& origin = surface.x[common];
  const Vec<2>& p = surface.x[a[0] == common ? a[1] : a[0]];
  const Vec<2>& q = surface.x[b[0] == common ? b[1] : b[0]];
  if (orientation(origin, p, q) != 0) return false;
  const int axis = p[0] != origin[0] ? 0 : 1;
  return (p[axis] < origin[axis]) == (q[axis] < origin[axis]);
}

void check_surface(const Surface<2>& surface, const std::string& name, std::vector<Violation>& violations) {
  const auto& edges = surface.edges;
  const std::vector<Box<2>> boxes = boxes_of<2>(surface.x, edges);
  const Bvh<2> tree(boxes);
  std::vector<int> hits;
  for (int i = 0; i < static_cast<int>(edges.size()); ++i) {
    if (surface.is_obstacle(edges[i])) continue;  // met from the side of the body
    hits.clear();
    tree.query(boxes[i], hits);
    for (const int j : hits) {
      if (!surface.is_obstacle(edges[j]) && j <= i) continue;
      const auto &a = edges[i], &b = edges[j];
      if (surface.are_seen_as_curves(a, b)) continue;
      const bool meet = num_shared(a, b) > 0
                            ? is_folded(surface, a, b)
                            : segments_intersect(surface.x[a[0]], surface.x[a[1]], surface.x[b[0]], surface.x[b[1]]);
      if (meet)
        violations.push_back(
            {Of::surfaces, fmt::format("{}: edges {} and {} intersect", name, surface.name(a), surface.name(b))});
    }
  }
}

void check_surface(const Surface<3>& surface, const std::string& name, std::vector<Violation>& violations) {
  const Bvh<3> tree(boxes_of<3>(surface.x, surface.triangles));
  const std::vector<Box<3>> boxes = boxes_of<3>(surface.x, surface.edges);
  std::vector<int> hits;
  for (std::size_t i = 0; i < surface.edges.size(); ++i) {
    const auto& e = surface.edges[i];
    hits.clear();
    tree.query(boxes[i], hits);
    for (const int j : hits) {
      const auto& t = surface.triangles[j];
      const int shared = num_shared(e, t);
      if ((surface.is_obstacle(e) && surface.is_obstacle(t)) || shared > 1) continue;
      if (surface.are_seen_as_curves(e, t)) continue;
      const auto& x = surface.x;
      const bool meet =
          shared == 1 ? is_folded(surface, e, t) : segment_intersects_triangle(x[e[0]], x[e[1]], x[t[0]], x[t[1]], x[t[2]]);
      if (!meet) continue;
      violations.push_back(
          {Of::surfaces, fmt::format("{}: edge {} and triangle {} intersect", name, surface.name(e), surface.name(t))});
    }
  }
}

/// Finds vertices inside of bodies, where no surfaces cross. A surface of obstacles may hold bodies: it is a container.
/// `in_hollows`: vertices that chords have inside and curves have not.
template <int Dim>
void check_insides(const Surface<Dim>& surface, const std::set<int>& in_hollows, const std::string& name,
                   std::vector<Violation>& violations) {
  const ClosedSurface<Dim> closed(surface.x, surface.own_facets);
  const std::string what = surface.has_proxy ? "the proxy" : "a body";
  const int first = surface.has_proxy ? 0 : surface.num_body_vertices;
  for (int v = first; v < static_cast<int>(surface.x.size()); ++v) {
    if (closed.is_vertex(v)) continue;
    const bool touches = closed.touches(surface.x[v]);
    if (touches || (closed.winding(surface.x[v]) + static_cast<int>(in_hollows.count(v))) % 2 != 0)
      violations.push_back({Of::surfaces, fmt::format("{}: vertex ({}) is {} {}", name, surface.name(v),
                                                      touches ? "on" : "inside of", what)});
  }
  if (surface.has_proxy) return;  // need not have an orientation that tells a solid from a cavity
  for (const int v : closed.nested())
    violations.push_back(
        {Of::surfaces, fmt::format("{}: the part of the boundary at vertex {} is inside of a body", name, surface.name(v))});
}

bool is_nearer(const Vec<2>& a, const Vec<2>& b, const Surface<2>& surface, int primitive, double distance) {
  const auto [p, q] = surface.edges[primitive];
  const Vec<2>&c = surface.x[p], &d = surface.x[q];
  return std::min({point_edge_distance_squared<2>(a, c, d), point_edge_distance_squared<2>(b, c, d),
                   point_edge_distance_squared<2>(c, a, b), point_edge_distance_squared<2>(d, a, b)}) < distance * distance;
}
bool is_nearer(const Vec<3>& a, const Vec<3>& b, const Surface<3>& surface, int primitive, double distance) {
  const auto [p, q, r] = surface.triangles[primitive];
  const Vec<3>&c = surface.x[p], &d = surface.x[q], &e = surface.x[r];
  return std::min({point_triangle_distance_squared(a, c, d, e), point_triangle_distance_squared(b, c, d, e),
                   edge_edge_distance_squared(a, b, c, d), edge_edge_distance_squared(a, b, d, e),
                   edge_edge_distance_squared(a, b, e, c)}) < distance * distance;
}

/// Fills in what curved edges do beyond their chords. Pieces of the surface around an edge do not count as something else.
template <int Dim>
void measure_overhangs(const StoredFrame& frame, const Surface<Dim>& surface, Certificate& certificate) {
  const CurvedNodes node_of(frame);
  if (node_of.edges.empty() || surface.has_proxy) return;
  const auto& primitives = facets_of(surface);
  const Bvh<Dim> tree(boxes_of<Dim>(surface.x, primitives));
  const auto& x = surface.x;
  std::vector<int> hits;
  for (const auto& facet : boundary_facets<Dim>(frame.simplices))
    for (int k = 0; k < (Dim == 2 ? 1 : 3); ++k) {
      const int a = facet[k], b = facet[(k + 1) % Dim], node = node_of(a, b);
      if (node == kNone) continue;
      std::array<Vec<Dim>, Dim> corners;
      for (int i = 0; i < Dim; ++i) corners[i] = x[facet[i]];
      const double height = distance_from_chords<Dim>(corners, k, (k + 1) % Dim, x[node]);
      certificate.overhang = std::max(certificate.overhang, height);
      if (height <= certificate.blocked_overhang) continue;
      Box<Dim> box;
      for (const int v : {a, b, node}) box.include(x[v]);
      hits.clear();
      tree.query(box.inflated(height), hits);
      std::vector<int> around;
      for (const int i : hits)
        if (num_shared(primitives[i], std::array{a, b, node}) > 0)
          around.insert(around.end(), primitives[i].begin(), primitives[i].end());
      const auto is_around = [&](int v) { return std::find(around.begin(), around.end(), v) != around.end(); };
      if (std::any_of(hits.begin(), hits.end(), [&](int i) {
            return std::none_of(primitives[i].begin(), primitives[i].end(), is_around) &&
                   (is_nearer(x[a], x[node], surface, i, height) || is_nearer(x[node], x[b], surface, i, height));
          }))
        certificate.blocked_overhang = height;
    }
}

/// The true boundary of the bodies, then the obstacles, whose edges and vertices are triangles without an area in 3D.
template <int Dim>
struct Patches {
  std::vector<std::array<int, Dim>> facets;
  std::vector<QuadraticPatch<Dim>> patches;
  std::vector<char> is_curved;
};

template <int Dim>
Patches<Dim> true_surface(const StoredFrame& frame, const Surface<Dim>& surface) {
  Patches<Dim> result;
  const CurvedNodes node_of(frame);
  const auto& x = surface.x;
  const auto add = [&](const std::array<int, Dim>& facet) {
    bool is_curved = false;
    std::array<Vec<Dim>, Dim> corners;
    for (int k = 0; k < Dim; ++k) corners[k] = x[facet[k]];
    result.patches.push_back(quadratic_patch<Dim>(corners, [&](int i, int j) -> Vec<Dim> {
      const int node = surface.is_obstacle(facet) ? kNone : node_of(facet[i], facet[j]);
      is_curved = is_curved || node != kNone;
      return node != kNone ? x[node] : Vec<Dim>((corners[i] + corners[j]) / 2);
    }));
    result.facets.push_back(facet);
    result.is_curved.push_back(is_curved);
  };
  for (const auto& facet : boundary_facets<Dim>(frame.simplices)) add(facet);
  for (const auto& facet : facets_of(surface))
    if (surface.is_obstacle(facet)) add(facet);
  if constexpr (Dim == 3)
    for (const auto& [a, b] : surface.edges)
      if (surface.is_obstacle(std::array{a, b})) add({a, b, b});
  for (int v = surface.num_body_vertices; v < static_cast<int>(x.size()); ++v) {
    std::array<int, Dim> point;
    point.fill(v);
    add(point);
  }
  return result;
}

/// Calls visit(vertex, curve, is_hollow) for vertices between a curve and its chords, where neither is crossed. `is_hollow`:
/// the curve lies on the body's side of the chord.
template <typename Visit>
void for_each_beyond_chord(const Surface<2>& surface, const Patches<2>& all, const Visit& visit) {
  for (std::size_t i = 0; i < all.patches.size(); ++i) {
    if (!all.is_curved[i]) continue;
    Box<2> box;
    for (const auto& row : all.patches[i].at)
      for (const Vec<2>& p : row) box.include(p);
    const auto halves = parts_of(all.patches[i]);
    for (std::size_t j = 0; j < all.facets.size(); ++j) {
      const auto& other = all.facets[j];
      const bool has_points = surface.is_obstacle(other) && other[0] != other[1];  // ends are tested as points
      if (has_points || num_shared(all.facets[i], other) > 0) continue;
      const Vec<2>& p = surface.x[other[0]];
      if ((p.array() < box.min.array()).any() || (p.array() > box.max.array()).any()) continue;
      for (const auto& half : halves)
        if (is_beyond_chord(half, p)) visit(other[0], i, orientation(half.at[0][0], half.at[1][1], half.at[0][1]) > 0);
    }
  }
}

std::set<int> find_in_hollows(const Surface<2>& surface, const Patches<2>& all) {
  std::set<int> found;
  for_each_beyond_chord(surface, all, [&](int vertex, std::size_t, bool is_hollow) {
    if (is_hollow) found.insert(vertex);
  });
  return found;
}
/// Says of no vertex of 3D that it is in a hollow, which is the safe side.
std::set<int> find_in_hollows(const Surface<3>&, const Patches<3>&) { return {}; }

/// Proves by Bernstein bounds that true curves meet nothing. Neighbours in the surface are left to the cells.
template <int Dim>
void check_curves(const Surface<Dim>& surface, const Patches<Dim>& all, const std::string& name,
                  std::vector<Violation>& violations) {
  std::vector<Box<Dim>> boxes(all.patches.size());
  for (std::size_t i = 0; i < boxes.size(); ++i)
    for (const auto& row : all.patches[i].at)
      for (const Vec<Dim>& p : row) boxes[i].include(p);
  const Bvh<Dim> tree(boxes);
  std::vector<int> hits;
  for (int i = 0; i < static_cast<int>(boxes.size()); ++i) {
    if (!all.is_curved[i]) continue;
    hits.clear();
    tree.query(boxes[i], hits);
    for (const int j : hits) {
      if ((all.is_curved[j] && j <= i) || num_shared(all.facets[i], all.facets[j]) > 0) continue;
      if (!are_apart(all.patches[i], all.patches[j]))
        violations.push_back({Of::surfaces, fmt::format("{}: curve {} is not proven to be apart from {}", name,
                                                        surface.name(all.facets[i]), surface.name(all.facets[j]))});
    }
  }
  if constexpr (Dim == 2)
    for_each_beyond_chord(surface, all, [&](int vertex, std::size_t curve, bool is_hollow) {
      if (!is_hollow)
        violations.push_back({Of::surfaces, fmt::format("{}: vertex ({}) is between curve {} and its chords", name,
                                                        surface.name(vertex), surface.name(all.facets[curve]))});
    });
}

template <int Dim>
double flight(const StoredFrame& frame) {
  struct Sum {
    Vec<Dim> u = Vec<Dim>::Zero();
    int corners = 0;
  };
  const auto rest = points<Dim>(frame.rest), x = points<Dim>(frame.x);
  std::map<std::int64_t, Sum> bodies;
  Box<Dim> box;
  for (std::size_t c = 0; c < frame.body.size(); ++c) {
    Sum& sum = bodies[frame.body[c]];
    for (int k = 0; k <= Dim; ++k) {
      const std::int64_t v = frame.simplices[(Dim + 1) * c + k];
      sum.u += x[v] - rest[v];
      box.include(rest[v]);
      ++sum.corners;
    }
  }
  for (const Vec<Dim>& p : points<Dim>(frame.obstacles.x)) box.include(p);
  double longest = 0;
  for (const auto& [id, sum] : bodies) longest = std::max(longest, sum.u.norm() / sum.corners);
  return bodies.empty() ? 0 : longest / (box.max - box.min).norm();
}

template <int Dim>
void check_frame(const StoredFrame& frame, const std::string& name, Certificate& certificate) {
  std::vector<Violation>& violations = certificate.violations;
  // NaN compares false with everything, and every predicate after it would pass.
  const auto is_finite = [](double value) { return std::isfinite(value); };
  for (const auto* x : {&frame.rest, &frame.x, &frame.obstacles.x, &frame.proxy.x}) {
    if (std::all_of(x->begin(), x->end(), is_finite)) continue;
    violations.push_back({Of::file, name + ": a position is not finite"});
    return;
  }
  const std::size_t before = violations.size();
  check_cells<Dim>(frame, frame.rest, "at rest ", name, violations);
  check_cells<Dim>(frame, frame.x, "", name, violations);
  const Surface<Dim> surface = make_surface<Dim>(frame);
  check_surface(surface, name, violations);
  Patches<Dim> curves;
  if (!surface.curved.empty()) curves = true_surface(frame, surface);
  if (violations.size() == before) check_insides(surface, find_in_hollows(surface, curves), name, violations);
  check_curves(surface, curves, name, violations);
  measure_overhangs(frame, surface, certificate);
  certificate.flight = std::max(certificate.flight, flight<Dim>(frame));
}

std::vector<fs::path> frame_files(const fs::path& directory) {
  std::vector<fs::path> files = stored_frames(directory);
  if (files.empty()) throw InputError({directory.string(), "frames", "no *.h5 there", "a folder that `itr run` wrote"});
  return files;
}

}  // namespace

Certificate certify(const fs::path& directory) {
  Certificate certificate;
  for (const fs::path& file : frame_files(directory)) {
    const std::string name = "frames/" + file.filename().string();
    ++certificate.frames;
    if (const auto damaged = find_damage(file); !damaged.empty()) {
      for (const std::string& what : damaged)
        certificate.violations.push_back({Of::file, fmt::format("{}: {} is damaged: not what was written", name, what)});
      continue;
    }
    const StoredFrame frame = read_frame(file);
    certificate.units = frame.units;
    if (frame.dim == 2) {
      check_frame<2>(frame, name, certificate);
    } else {
      check_frame<3>(frame, name, certificate);
    }
  }
  return certificate;
}

}  // namespace itr::output
