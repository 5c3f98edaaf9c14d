// SPDX-License-Identifier: MIT
// Obstacles: collision-only surfaces out of mesh files (docs/theory.md, "Meshes").
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <set>

#include "core/sorted.hpp"
#include "geometry.hpp"
#include "mesh/rest_box.hpp"
#include "mesh_sequence.hpp"
#include "shapes.hpp"
#include "transformation.hpp"

namespace itr::scene {

namespace {

using Edge = std::array<int, 2>;
using Triangle = std::array<int, 3>;

/// Surface primitives over the points of one file.
struct Surface {
  std::vector<Edge> edges;  ///< those of the file and of faces, each once
  std::vector<Triangle> triangles;
  std::vector<char> is_used;  ///< per point; points inside of a solid are not
};

/// Adds an edge unless it is there in either direction.
class EdgeList {
 public:
  void add(const Edge& edge) {
    if (seen_.insert(sorted(edge)).second) edges_.push_back(edge);
  }
  std::vector<Edge> take() { return std::move(edges_); }

 private:
  std::set<Edge> seen_;
  std::vector<Edge> edges_;
};

/// Facets of simplices that belong to one of them only, in the orientation that they have there.
template <std::size_t N>
std::vector<std::array<int, N - 1>> boundary_of(const std::vector<std::array<int, N>>& cells) {
  std::map<std::array<int, N - 1>, std::pair<int, std::array<int, N - 1>>> facets;
  for (const auto& cell : cells)
    for (std::size_t opposite = 0; opposite < N; ++opposite) {
      std::array<int, N - 1> facet;
      for (std::size_t k = 0; k + 1 < N; ++k) facet[k] = cell[k < opposite ? k : k + 1];
      if (opposite % 2 == 1) std::swap(facet[0], facet[1]);
      auto& [count, oriented] = facets[sorted(facet)];
      ++count;
      oriented = facet;
    }
  std::vector<std::array<int, N - 1>> boundary;
  for (const auto& [key, entry] : facets)
    if (entry.first == 1) boundary.push_back(entry.second);
  return boundary;
}

/// A point that only the cells of a solid use is used if it is on their boundary.
template <typename Cells, typename Facets>
std::vector<char> find_used(std::size_t num_points, const Cells& solid, const Facets& boundary,
                            const std::vector<Edge>& edges) {
  std::vector<char> is_used(num_points, true);
  for (const auto& cell : solid)
    for (const int v : cell) is_used[v] = false;
  for (const auto& facet : boundary)
    for (const int v : facet) is_used[v] = true;
  for (const Edge& edge : edges)
    for (const int v : edge) is_used[v] = true;
  return is_used;
}

Surface extract_surface(const MeshFile& file, const std::vector<Vec<2>>& points) {
  std::vector<Triangle> triangles = file.triangles;
  for (Triangle& t : triangles) {
    const Vec<2> a = points[t[1]] - points[t[0]], b = points[t[2]] - points[t[0]];
    if (a[0] * b[1] - a[1] * b[0] < 0) std::swap(t[0], t[1]);
  }
  const std::vector<Edge> boundary = boundary_of(triangles);
  EdgeList edges;
  for (const Edge& edge : file.edges) edges.add(edge);
  for (const Edge& edge : boundary) edges.add(edge);
  return {edges.take(), {}, find_used(points.size(), triangles, boundary, file.edges)};
}

Surface extract_surface(const MeshFile& file, const std::vector<Vec<3>>& points) {
  const std::vector<Triangle> triangles = file.tetrahedra.empty() ? file.triangles : boundary_of(file.tetrahedra);
  EdgeList edges;
  for (const Edge& edge : file.edges) edges.add(edge);
  for (const Triangle& t : triangles)
    for (const Edge& edge : {Edge{t[0], t[1]}, Edge{t[1], t[2]}, Edge{t[2], t[0]}}) edges.add(edge);
  return {edges.take(), triangles, find_used(points.size(), file.tetrahedra, triangles, file.edges)};
}

/// Splits every edge in two and every triangle in four.
template <int Dim>
void refine_once(double where, Surface& surface, std::vector<Vec<Dim>>& points) {
  std::map<Edge, int> middles;
  std::vector<Edge> edges;
  for (const auto& [a, b] : surface.edges) {
    const int middle = middles[sorted(Edge{a, b})] = static_cast<int>(points.size());
    points.push_back((1 - where) * points[a] + where * points[b]);
    edges.insert(edges.end(), {{a, middle}, {middle, b}});
  }
  std::vector<Triangle> triangles;
  for (const auto& [a, b, c] : surface.triangles) {
    const int ab = middles.at(sorted(Edge{a, b})), bc = middles.at(sorted(Edge{b, c})), ca = middles.at(sorted(Edge{c, a}));
    triangles.insert(triangles.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    edges.insert(edges.end(), {{ab, bc}, {bc, ca}, {ca, ab}});
  }
  surface.edges = std::move(edges);
  surface.triangles = std::move(triangles);
  surface.is_used.resize(points.size(), true);
}

template <int Dim>
void refine(const Node& geometry, Surface& surface, std::vector<Vec<Dim>>& points) {
  constexpr int kMostTimes = 16;
  constexpr double kMostEdges = 2e7;
  const int times = geometry["n_refs"].integer_at_least(0, 0);
  if (times > kMostTimes) geometry["n_refs"].fail("at most " + std::to_string(kMostTimes));
  const double edges = std::ldexp(surface.edges.size(), times) + std::ldexp(1.5 * surface.triangles.size(), 2 * times);
  if (times > 0 && edges > kMostEdges) geometry["n_refs"].fail("less refinement: too many edges");
  const Node location = geometry["advanced"]["refinement_location"];
  const double where = location.number(0.5);
  if (!(where > 0 && where < 1)) location.fail("a number between 0 and 1");
  for (int i = 0; i < times; ++i) refine_once<Dim>(where, surface, points);
}

template <int Dim>
void check_lengths(const Node& mesh, const Surface& surface, const std::vector<Vec<Dim>>& points) {
  for (const auto& [a, b] : surface.edges)
    if (!((points[a] - points[b]).norm() > 0))
      mesh.fail("a surface edge of length 0 (vertices " + std::to_string(a) + " and " + std::to_string(b) + ")",
                "no degenerate surfaces");
}

Vec<3> in_space(const Vec<2>& p) { return {p[0], p[1], 0}; }
const Vec<3>& in_space(const Vec<3>& p) { return p; }

std::vector<SurfaceTriangle> triangles_of(const Surface& surface, const std::vector<Vec<2>>& points) {
  std::vector<SurfaceTriangle> triangles;
  for (const auto& [a, b] : surface.edges) std::ranges::copy(raised(points[a], points[b]), std::back_inserter(triangles));
  return triangles;
}
std::vector<SurfaceTriangle> triangles_of(const Surface& surface, const std::vector<Vec<3>>& points) {
  std::vector<SurfaceTriangle> triangles;
  for (const auto& [a, b, c] : surface.triangles) triangles.push_back({points[a], points[b], points[c]});
  return triangles;
}

/// Puts a surface onto a shape and cuts its edges in two until the shape turns along none by more than kMostTurn, and no
/// middle is farther off it than the sag that the scene gives.
template <int Dim>
class ShapedSurface {
 public:
  ShapedSurface(const ShapeEntry& entry, Surface& surface, std::vector<Vec<Dim>>& points)
      : entry_(entry), surface_(surface), points_(points), shape_(shape_through<Dim>(entry, triangles_of(surface, points))) {
    if (shape_.kind != Shape::Kind::fitted) return;
    std::vector<std::array<Vec<3>, 2>> segments;
    for (const auto& [a, b] : surface.edges) segments.push_back({in_space(points[a]), in_space(points[b])});
    shape_.fitted = fit_curves(segments, shape_.angle);
  }

  void refine() {
    constexpr int kMostRounds = 16;
    constexpr std::size_t kMostEdges = 2'000'000;
    for (std::size_t v = 0; v < points_.size(); ++v)
      if (surface_.is_used[v]) put_on(points_[v]);
    for (int round = 0; round < kMostRounds && mark(); ++round) {
      cut();
      if (surface_.edges.size() > kMostEdges)
        entry_.node["sag"].fail(fmt::format("an obstacle of more than {} edges on its shape", kMostEdges), "a larger sag");
    }
  }

 private:
  /// Moves a point to the nearest place of the shape: one step is exact but at curves.
  void put_on(Vec<Dim>& point) const {
    for (int i = 0; i < 2; ++i) {
      const ShapeOffset offset = offset_from(shape_, in_space(point));
      point -= offset.distance * offset.normal.template head<Dim>();
    }
  }
  bool is_coarse(const Edge& edge) const {
    const Vec<Dim>&a = points_[edge[0]], &b = points_[edge[1]];
    const double sag = std::abs(offset_from(shape_, in_space(Vec<Dim>((a + b) / 2))).distance);
    return sag > kMostSag<Dim> * (b - a).norm() || (shape_.sag > 0 && sag > shape_.sag);
  }
  /// Makes the middles of coarse edges; whether there are any.
  bool mark() {
    middles_.clear();
    for (const Edge& edge : surface_.edges) {
      if (!is_coarse(edge)) continue;
      middles_.emplace(sorted(edge), static_cast<int>(points_.size()));
      points_.push_back((points_[edge[0]] + points_[edge[1]]) / 2);
      put_on(points_.back());
    }
    surface_.is_used.resize(points_.size(), true);
    return !middles_.empty();
  }
  int middle_of(int a, int b) const {
    const auto found = middles_.find(sorted(Edge{a, b}));
    return found == middles_.end() ? kNone : found->second;
  }
  void cut() {
    EdgeList edges;
    for (const auto& [a, b] : surface_.edges) {
      const int middle = middle_of(a, b);
      if (middle == kNone) {
        edges.add({a, b});
      } else {
        edges.add({a, middle});
        edges.add({middle, b});
      }
    }
    std::vector<Triangle> triangles;
    for (const Triangle& triangle : surface_.triangles) bisect(triangle, triangles);
    for (const Triangle& t : triangles)
      for (const Edge& edge : {Edge{t[0], t[1]}, Edge{t[1], t[2]}, Edge{t[2], t[0]}}) edges.add(edge);
    surface_.edges = edges.take();
    surface_.triangles = std::move(triangles);
  }
  /// Cuts the longest edge that has a middle, then those of both halves.
  void bisect(const Triangle& triangle, std::vector<Triangle>& made) const {
    int longest = kNone;
    double most = 0;
    for (int k = 0; k < 3; ++k) {
      const int a = triangle[k], b = triangle[(k + 1) % 3];
      const double length = (points_[a] - points_[b]).norm();
      if (middle_of(a, b) == kNone || !(length > most)) continue;
      longest = k;
      most = length;
    }
    if (longest == kNone) {
      made.push_back(triangle);
      return;
    }
    const int a = triangle[longest], b = triangle[(longest + 1) % 3], c = triangle[(longest + 2) % 3];
    bisect({a, middle_of(a, b), c}, made);
    bisect({middle_of(a, b), b, c}, made);
  }

  const ShapeEntry& entry_;
  Surface& surface_;
  std::vector<Vec<Dim>>& points_;
  Shape shape_;
  std::map<Edge, int> middles_;  ///< by edge
};

/// Refines an obstacle on its shape, if it has one.
template <int Dim>
void put_onto(const std::vector<ShapeEntry>& shapes, int id, Surface& surface, std::vector<Vec<Dim>>& points) {
  for (const ShapeEntry& entry : shapes)
    if (std::ranges::find(entry.shape.surfaces, id) != entry.shape.surfaces.end())
      ShapedSurface<Dim>(entry, surface, points).refine();
}

template <int Dim>
void append(const Surface& surface, const std::vector<Vec<Dim>>& points, const Vec<Dim>& shift, int id,
            ObstacleGeometry<Dim>& out) {
  std::vector<int> renumbered(points.size(), kNone);
  for (std::size_t v = 0; v < points.size(); ++v) {
    if (!surface.is_used[v]) continue;
    renumbered[v] = static_cast<int>(out.obstacles.rest.size());
    out.obstacles.rest.push_back(points[v] + shift);
    out.obstacles.motion.push_back(kNone);
    out.id.push_back(id);
  }
  for (const auto& [a, b] : surface.edges) out.obstacles.edges.push_back({renumbered[a], renumbered[b]});
  for (const auto& [a, b, c] : surface.triangles)
    out.obstacles.triangles.push_back({renumbered[a], renumbered[b], renumbered[c]});
}

template <int Dim>
void read_obstacle(const Node& geometry, MeshFiles& files, const Sets& sets, const std::vector<ShapeEntry>& shapes,
                   ObstacleGeometry<Dim>& out) {
  const MeshFile& file = files.get(geometry);
  if (Dim == 2 && !is_flat(file))
    geometry["mesh"].fail(abbreviate(geometry["mesh"].json()) + ", a surface in space, where no body has tetrahedra (2D)",
                          "a line or a flat mesh");
  std::vector<Vec<Dim>> points = points_of<Dim>(file);
  transform<Dim>(points, geometry);
  put_on_axis<Dim>(geometry, points);
  const Box<Dim> box = bounding_box<Dim>(points);
  Surface surface = extract_surface(file, points);
  refine<Dim>(geometry, surface, points);
  const int extract = geometry["extract"].choice({"volume", "surface", "edges", "points"}, 0);
  if (extract == 2) surface.triangles.clear();
  if (extract == 3) surface.triangles.clear(), surface.edges.clear();
  check_lengths<Dim>(geometry["mesh"], surface, points);
  const int id = read_obstacle_id(geometry, sets);
  const bool is_sequence = is_mesh_sequence(geometry);
  if (id != kNoTag && extract < 2 && !is_sequence) put_onto<Dim>(shapes, id, surface, points);
  const std::size_t first = out.obstacles.rest.size();
  for (const Vec<Dim>& shift : read_copies<Dim>(geometry, box.sizes())) append<Dim>(surface, points, shift, id, out);
  if (is_sequence) add_sequence<Dim>(geometry, files, surface.is_used, first, out.obstacles);
}

/// One edge or triangle that reaches ten times as far as the bodies do at the start, seen from above their middle: an edge
/// inside of the plane would add pairs to those of the faces beside it, whose barrier pushes sideways.
template <int Dim>
void read_flat(const Node& geometry, const Box<Dim>& bodies, const Sets& sets, ObstacleGeometry<Dim>& out) {
  constexpr double kReach = 10;
  Vec<Dim> point = Vec<Dim>::Zero(), normal = Vec<Dim>::Unit(1);
  const auto read_point = [](const Node& node, Vec<Dim>& result) {
    const std::vector<double> values = node.numbers();
    if (values.size() != Dim) node.fail(std::to_string(Dim) + " numbers");
    result = Eigen::Map<const Vec<Dim>>(values.data());
  };
  if (geometry["type"].string("") == "ground") {
    point[1] = geometry["height"].number(0);
  } else {
    if (const Node node = geometry["point"]; node.exists()) read_point(node, point);
    if (!geometry.has("normal")) geometry["normal"].fail("the direction in which the plane faces");
    read_point(geometry["normal"], normal);
    if (!(normal.norm() > 0)) geometry["normal"].fail("a direction");
    normal.normalize();
  }
  const Vec<Dim> middle = bodies.center() - normal.dot(bodies.center() - point) * normal;
  const double reach = kReach * std::max(bodies.diagonal().norm(), (bodies.center() - middle).norm());
  Surface surface;
  std::vector<Vec<Dim>> points;
  if constexpr (Dim == 2) {
    const Vec<2> along(-normal[1], normal[0]);
    points = {middle - reach * along, middle + reach * along};
    surface.edges = {{0, 1}};
  } else {
    Eigen::Index least = 0;
    normal.cwiseAbs().minCoeff(&least);
    const Vec<3> a = reach * normal.cross(Vec<3>(Vec<3>::Unit(least))).normalized(), b = normal.cross(a);
    points = {middle - std::sqrt(3.0) * a - b, middle + std::sqrt(3.0) * a - b, middle + 2 * b};
    surface.edges = {{0, 1}, {1, 2}, {2, 0}};
    surface.triangles = {{0, 1, 2}};
  }
  surface.is_used.assign(points.size(), true);
  out.obstacles.flats.push_back(static_cast<int>(out.obstacles.rest.size()));
  append<Dim>(surface, points, Vec<Dim>::Zero(), read_obstacle_id(geometry, sets), out);
}

}  // namespace

template <int Dim>
ObstacleGeometry<Dim> read_obstacles(const Geometries& geometries, MeshFiles& files, const Mesh<Dim>& bodies,
                                     const Sets& sets, const std::vector<ShapeEntry>& shapes,
                                     std::vector<std::string>& warnings) {
  ObstacleGeometry<Dim> all;
  for (const Node& geometry : geometries.obstacles) {
    const int part = all.part.empty() ? 0 : all.part.back() + 1;
    if (is_flat_obstacle(geometry))
      read_flat<Dim>(geometry, rest_box(bodies), sets, all);
    else
      read_obstacle<Dim>(geometry, files, sets, shapes, all);
    all.part.resize(all.obstacles.rest.size(), part);
  }
  files.take_notes(warnings);
  return all;
}

std::optional<Label> read_obstacle_label(const Node& geometry) {
  const Node node = geometry["surface_selection"];
  if (!node.exists()) {
    const std::string name = geometry["name"].string("");
    return name.empty() ? std::nullopt : std::optional(Label{0, name});
  }
  if (!node.json().is_number() && !node.json().is_string()) node.fail("a number or a name: an obstacle has one id");
  return read_label(node, 0);
}

int read_obstacle_id(const Node& geometry, const Sets& sets) {
  const std::optional<Label> label = read_obstacle_label(geometry);
  return label && !sets.surfaces.of(*label).empty() ? sets.surfaces.of(*label).front() : kNoTag;
}

template <int Dim>
Obstacles<Dim> read_surface(const Node& holder, const Node& geometry, MeshFiles& files) {
  const MeshFile& file = files.get(holder);
  std::vector<Vec<Dim>> points = points_of<Dim>(file);
  transform<Dim>(points, geometry);
  Surface surface = extract_surface(file, points);
  if (std::find(surface.is_used.begin(), surface.is_used.end(), 0) != surface.is_used.end())
    holder["mesh"].fail(abbreviate(holder["mesh"].json()) + " with points inside of a solid", "a surface");
  check_lengths<Dim>(holder["mesh"], surface, points);
  return {std::move(points), std::move(surface.edges), std::move(surface.triangles), {}, {}};
}

#define ITR_INSTANTIATE(Dim)                                                                                  \
  template Obstacles<Dim> read_surface(const Node&, const Node&, MeshFiles&);                                 \
  template ObstacleGeometry<Dim> read_obstacles(const Geometries&, MeshFiles&, const Mesh<Dim>&, const Sets&, \
                                                const std::vector<ShapeEntry>&, std::vector<std::string>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr::scene
