// SPDX-License-Identifier: MIT
#include "shapes.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <numbers>
#include <set>
#include <utility>

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

double read_length(const Node& node, const char* key) {
  if (!node.has(key)) node.fail("no " + std::string(key), "it beside the type");
  return node[key].positive(1);
}

constexpr std::pair<const char*, Shape::Kind> kTypes[] = {
    {"plane", Shape::Kind::plane},       {"sphere", Shape::Kind::sphere}, {"circle", Shape::Kind::sphere},
    {"cylinder", Shape::Kind::cylinder}, {"cone", Shape::Kind::cone},     {"torus", Shape::Kind::torus},
    {"fitted", Shape::Kind::fitted}};

Shape read_shape(const Node& node, int dim, const std::set<int>& with_facets, const Sets& sets) {
  using enum Shape::Kind;
  Shape shape{.surfaces = read_surfaces(node["surface"], sets, with_facets, "the ids of the surfaces that have the shape")};
  std::vector<std::string> types;
  for (const auto& [name, kind] : kTypes) types.emplace_back(name);
  if (!node.has("type")) node.fail("no type", fmt::format("one of {}", fmt::join(types, ", ")));
  const int chosen = node["type"].choice(types, 0);
  const std::string& type = types[chosen];
  shape.kind = kTypes[chosen].second;
  if (node.has("sag")) shape.sag = node["sag"].positive(1);
  const bool is_round = shape.kind == cylinder || shape.kind == cone || shape.kind == torus;
  if (is_round && dim == 2) node["type"].fail("\"" + type + "\" in 2D", "plane, circle or fitted");
  if (shape.kind == fitted && dim == 3) node["type"].fail("\"fitted\" in 3D", "a geometry: fitted is for 2D");
  if (type == "circle" && dim == 3) node["type"].fail("\"circle\" in 3D", "sphere");
  if (shape.kind == fitted) {
    constexpr double kFeatureAngle = 40;  // keeps corners of octagons and lets 12 of them be a circle
    shape.angle = std::numbers::pi / 180 * node["feature_angle"].positive(kFeatureAngle);
    return shape;
  }
  if (!node.has("center")) node.fail("no center", "it beside the type");
  shape.center = read_vector_of(node["center"], dim, Vec<3>::Zero());
  if (shape.kind == plane || is_round) {
    if (!node.has("axis")) node.fail("no axis", "it beside the type: of a plane its normal");
    shape.axis = read_vector_of(node["axis"].without_units(), dim, shape.axis);
    if (!(shape.axis.norm() > 0)) node["axis"].fail("a direction");
    shape.axis.normalize();
  }
  if (shape.kind == cone) {
    shape.angle = std::numbers::pi / 180 * read_length(node, "angle");
    if (!(shape.angle < std::numbers::pi / 2)) node["angle"].fail("less than 90 degrees, between axis and surface");
  }
  if (shape.kind == sphere || shape.kind == cylinder || shape.kind == torus) shape.radius = read_length(node, "radius");
  if (shape.kind == torus) shape.tube_radius = read_length(node, "tube_radius");
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
    for (const int tag : shape->surfaces)
      if (!taken.insert(tag).second)
        node["surface"].fail(abbreviate(node["surface"].json()) + ", which another shape has, too", "one shape a surface");
  }
}

template void read_shapes(const Node&, const Sets&, Setup<2>&);
template void read_shapes(const Node&, const Sets&, Setup<3>&);

}  // namespace itr::scene
