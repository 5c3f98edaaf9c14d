// SPDX-License-Identifier: MIT
#include "shapes.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>
#include <set>
#include <string_view>
#include <vector>

#include "mesh/rest_box.hpp"
#include "supports.hpp"

namespace itr::scene {

namespace {

constexpr double kDegree = std::numbers::pi / 180;

/// Reads a point or a direction; what a 2D scene leaves out is 0.
Vec<3> read_vector_of(const Node& node, int dim, const Vec<3>& fallback) {
  if (!node.exists()) return fallback;
  const std::vector<double> numbers = node.numbers();
  if (static_cast<int>(numbers.size()) != dim) node.fail(std::to_string(dim) + " numbers");
  Vec<3> vector = Vec<3>::Zero();
  for (int i = 0; i < dim; ++i) vector[i] = numbers[i];
  return vector;
}

struct Type {
  std::string_view name;
  Shape::Kind kind;
  std::vector<std::string_view> required;  ///< keys beside the type; those of other types mean nothing
};
const Type kTypes[] = {{"plane", Shape::Kind::plane, {"center", "axis"}},
                       {"sphere", Shape::Kind::sphere, {"center", "radius"}},
                       {"circle", Shape::Kind::sphere, {"center", "radius"}},
                       {"cylinder", Shape::Kind::cylinder, {"center", "axis", "radius"}},
                       {"cone", Shape::Kind::cone, {"center", "axis", "angle"}},
                       {"torus", Shape::Kind::torus, {"center", "axis", "radius", "tube_radius"}},
                       {"fitted", Shape::Kind::fitted, {}}};

const Type& read_type(const Node& node, int dim) {
  std::vector<std::string> names;
  for (const Type& type : kTypes) names.emplace_back(type.name);
  if (!node.has("type")) node.fail("no type", fmt::format("one of {}", fmt::join(names, ", ")));
  const Type& type = kTypes[node["type"].choice(names, 0)];
  const std::string found = fmt::format("\"{}\" in {}D", type.name, dim);
  using enum Shape::Kind;
  if (dim == 2 && (type.kind == cylinder || type.kind == cone || type.kind == torus))
    node["type"].fail(found, "plane, circle or fitted");
  if (dim == 3 && type.name == "circle") node["type"].fail(found, "sphere");
  return type;
}

/// Refuses a shape with a key of other types, and one with some of its keys but not all. Returns whether it has them.
bool check_keys(const Node& node, const Type& type) {
  const bool has_any = std::ranges::any_of(type.required, [&](std::string_view key) { return node.has(std::string(key)); });
  for (const std::string key : {"center", "axis", "radius", "tube_radius", "angle", "feature_angle"}) {
    const bool is_required = std::ranges::find(type.required, key) != type.required.end();
    const bool is_allowed = is_required || (type.kind == Shape::Kind::fitted && key == "feature_angle");
    if (has_any && is_required && !node.has(key))
      node.fail("no " + key, fmt::format("{}, or none of {}: the vertices of the surface then tell them", key,
                                         fmt::join(type.required, ", ")));
    if (!is_allowed && node.has(key))
      node[key].fail(fmt::format("it beside \"{}\"", type.name), fmt::format("no {} there", key));
  }
  return has_any;
}

/// The numbers that stand in an entry.
void read_numbers(const Node& node, int dim, Shape& shape) {
  shape.center = read_vector_of(node["center"], dim, shape.center);
  if (node.has("axis")) {
    shape.axis = read_vector_of(node["axis"].without_units(), dim, shape.axis);
    if (!(shape.axis.norm() > 0)) node["axis"].fail("a direction");
    shape.axis.normalize();
  }
  if (node.has("angle")) {
    shape.angle = kDegree * node["angle"].positive(1);
    if (!(shape.angle < std::numbers::pi / 2)) node["angle"].fail("less than 90 degrees, between axis and surface");
  }
  if (node.has("radius")) shape.radius = node["radius"].positive(1);
  if (node.has("tube_radius")) shape.tube_radius = node["tube_radius"].positive(1);
}

ShapeEntry read_entry(const Node& node, int dim, const std::set<int>& surfaces, const Sets& sets) {
  constexpr double kFeatureAngle = 40;  // keeps corners of octagons, and lets 12 be a circle
  Shape shape{.surfaces = read_surfaces(node["surface"], sets, surfaces, "the ids of the surfaces that have the shape")};
  const Type& type = read_type(node, dim);
  const bool has_numbers = check_keys(node, type);
  shape.kind = type.kind;
  if (node.has("sag")) shape.sag = node["sag"].positive(1);
  if (type.kind == Shape::Kind::fitted && dim == 2) shape.angle = kDegree * node["feature_angle"].positive(kFeatureAngle);
  read_numbers(node, dim, shape);
  return {node, std::move(shape), has_numbers};
}

/// Corners of the boundary facets that have one of these tags, as triangles.
template <int Dim>
std::vector<SurfaceTriangle> triangles_of(const Mesh<Dim>& mesh, const std::vector<int>& tags) {
  std::vector<SurfaceTriangle> triangles;
  for (const FacetId f : mesh.live_facets()) {
    if (std::ranges::find(tags, mesh.facet_tag(f)) == tags.end()) continue;
    const auto& v = mesh.facet(f);
    if constexpr (Dim == 2)
      std::ranges::copy(raised(mesh.rest(v[0]), mesh.rest(v[1])), std::back_inserter(triangles));
    else
      triangles.push_back({mesh.rest(v[0]), mesh.rest(v[1]), mesh.rest(v[2])});
  }
  return triangles;
}

double diagonal_of(std::span<const SurfaceTriangle> triangles) {
  Eigen::AlignedBox<double, 3> box;
  for (const SurfaceTriangle& triangle : triangles)
    for (const Vec<3>& corner : triangle) box.extend(corner);
  return box.diagonal().norm();
}

/// Vertices that a surface begins with are moved onto their shape, but not far: as far as one is that refines a polygon.
template <int Dim>
void check_distance(const ShapeEntry& entry, std::span<const SurfaceTriangle> triangles) {
  constexpr double kFar = 0.05;  // of the diagonal
  double farthest = 0;
  for (const SurfaceTriangle& triangle : triangles)
    for (Vec<3> corner : triangle) {
      if (Dim == 2) corner[2] = 0;
      farthest = std::max(farthest, std::abs(offset_from(entry.shape, corner).distance));
    }
  if (farthest > kFar * diagonal_of(triangles))
    entry.node.fail(
        fmt::format("a geometry that a vertex of its surface is {} off", entry.node.document().units.text(farthest, "m", 3)),
        "one that all vertices of the surface lie on");
}

}  // namespace

std::array<SurfaceTriangle, 2> raised(const Vec<2>& a, const Vec<2>& b) {
  const Vec<3> low_a(a[0], a[1], 0), low_b(b[0], b[1], 0), up(0, 0, (b - a).norm());
  return {SurfaceTriangle{low_a, low_b, low_b + up}, SurfaceTriangle{low_a, low_b + up, low_a + up}};
}

template <int Dim>
std::vector<ShapeEntry> read_shapes(const Node& root, const Sets& sets, const std::set<int>& surfaces) {
  std::vector<ShapeEntry> entries;
  std::set<int> taken;
  for (const Node& node : root["shapes"].items()) {
    entries.push_back(read_entry(node, Dim, surfaces, sets));
    for (const int tag : entries.back().shape.surfaces)
      if (!taken.insert(tag).second)
        node["surface"].fail(abbreviate(node["surface"].json()) + ", which another shape has, too", "one shape a surface");
  }
  return entries;
}

template <int Dim>
Shape shape_through(const ShapeEntry& entry, std::span<const SurfaceTriangle> triangles) {
  constexpr double kTolerance = 1e-5;  // of the diagonal: meshes of CAD programs have fewer digits than doubles
  using enum Shape::Kind;
  const Shape& asked = entry.shape;
  if (Dim == 2 && asked.kind == fitted) return asked;
  if (entry.has_numbers) {
    check_distance<Dim>(entry, triangles);
    return asked;
  }
  const double tolerance = kTolerance * diagonal_of(triangles);
  const std::optional<ShapeFit> fit = asked.kind == fitted
                                          ? recognize_shape(triangles, tolerance)
                                          : fit_shape(Dim == 2 && asked.kind == sphere ? cylinder : asked.kind, triangles);
  const std::string found = abbreviate(entry.node["surface"].json()) + ", whose vertices tell no ";
  const std::string expected = "a surface of one geometry, or the numbers of the type beside it";
  if (asked.kind == fitted && !fit) entry.node["surface"].fail(found + "plane, sphere, cylinder, cone or torus", expected);
  if (!fit || fit->farthest > tolerance)
    entry.node["surface"].fail(
        found + entry.node["type"].string("") +
            (fit ? fmt::format(": one is {} off the nearest", entry.node.document().units.text(fit->farthest, "m", 3)) : ""),
        expected);
  Shape shape = fit->shape;
  shape.surfaces = asked.surfaces;
  shape.sag = asked.sag;
  if (Dim == 2) {
    shape.kind = asked.kind;
    shape.center[2] = 0;
    if (asked.kind == plane) shape.axis = Vec<3>(shape.axis[0], shape.axis[1], 0).normalized();
  }
  return shape;
}

template <int Dim>
void add_shapes(const std::vector<ShapeEntry>& entries, Setup<Dim>& setup) {
  for (const ShapeEntry& entry : entries)
    if (const auto triangles = triangles_of<Dim>(setup.mesh, entry.shape.surfaces); !triangles.empty())
      setup.shapes.push_back(std::make_shared<const Shape>(shape_through<Dim>(entry, triangles)));
}

#define ITR_INSTANTIATE(Dim)                                                                         \
  template std::vector<ShapeEntry> read_shapes<Dim>(const Node&, const Sets&, const std::set<int>&); \
  template Shape shape_through<Dim>(const ShapeEntry&, std::span<const SurfaceTriangle>);            \
  template void add_shapes(const std::vector<ShapeEntry>&, Setup<Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr::scene
