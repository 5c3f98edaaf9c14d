// SPDX-License-Identifier: MIT
#include "shapes.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>
#include <string_view>
#include <vector>

#include "geometry/shape.hpp"
#include "supports.hpp"

namespace itr::scene {

namespace {

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
  if (dim == 3 && type.kind == fitted) node["type"].fail(found, "a geometry: fitted is for 2D");
  if (dim == 3 && type.name == "circle") node["type"].fail(found, "sphere");
  return type;
}

/// Refuses a shape without a key of its type, and one with a key of other types.
void check_keys(const Node& node, const Type& type) {
  for (const std::string key : {"center", "axis", "radius", "tube_radius", "angle", "feature_angle"}) {
    const bool is_required = std::ranges::find(type.required, key) != type.required.end();
    const bool is_allowed = is_required || (type.kind == Shape::Kind::fitted && key == "feature_angle");
    if (is_required && !node.has(key))
      node.fail("no " + key, key == "axis" ? "it beside the type: of a plane its normal" : "it beside the type");
    if (!is_allowed && node.has(key))
      node[key].fail(fmt::format("it beside \"{}\"", type.name), fmt::format("no {} there", key));
  }
}

Shape read_shape(const Node& node, int dim, const std::set<int>& with_facets, const Sets& sets) {
  constexpr double kDegree = std::numbers::pi / 180,
                   kFeatureAngle = 40;  // keeps corners of octagons, and lets 12 be a circle
  Shape shape{.surfaces = read_surfaces(node["surface"], sets, with_facets, "the ids of the surfaces that have the shape")};
  const Type& type = read_type(node, dim);
  check_keys(node, type);
  shape.kind = type.kind;
  if (node.has("sag")) shape.sag = node["sag"].positive(1);
  if (type.kind == Shape::Kind::fitted) shape.angle = kDegree * node["feature_angle"].positive(kFeatureAngle);
  if (node.has("center")) shape.center = read_vector_of(node["center"], dim, shape.center);
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
  return shape;
}

}  // namespace

template <int Dim>
void read_shapes(const Node& root, const Sets& sets, Setup<Dim>& setup) {
  const std::set<int> with_facets = sets.facet_tags(setup.mesh);
  std::set<int> taken;
  for (const Node& node : root["shapes"].items()) {
    const auto shape = std::make_shared<const Shape>(read_shape(node, Dim, with_facets, sets));
    setup.shapes.push_back(shape);
    for (const int tag : std::set<int>(shape->surfaces.begin(), shape->surfaces.end()))
      if (!taken.insert(tag).second)
        node["surface"].fail(abbreviate(node["surface"].json()) + ", which another shape has, too", "one shape a surface");
  }
}

template void read_shapes(const Node&, const Sets&, Setup<2>&);
template void read_shapes(const Node&, const Sets&, Setup<3>&);

}  // namespace itr::scene
