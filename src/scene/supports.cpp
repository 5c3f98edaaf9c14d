// SPDX-License-Identifier: MIT
// `/springs` and `/couplings` of a scene (docs/theory.md, "Springs" and "Coupled points").

#include "supports.hpp"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <numbers>
#include <set>
#include <string>

#include "mesh/facet_measure.hpp"
#include "mesh/facet_tags.hpp"
#include "mesh/turn.hpp"
#include "rigid.hpp"

namespace itr::scene {

namespace {

/// A number for all directions, one an axis, or rows.
Mat<3> read_stiffness(const Node& node, int dim) {
  Mat<3> stiffness = Mat<3>::Zero();
  if (!node.json().is_array()) {
    stiffness.diagonal().setConstant(node.non_negative(0));
  } else {
    const std::vector<Node> items = node.items();
    const std::string expected = fmt::format("a number, {0} numbers, or {0} rows of {0} numbers", dim);
    if (static_cast<int>(items.size()) != dim) node.fail(expected);
    const bool has_rows = items.front().json().is_array();
    for (int i = 0; i < dim; ++i) {
      const std::vector<double> row = has_rows ? items[i].numbers() : std::vector{items[i].number(0)};
      if (row.size() != (has_rows ? items.size() : 1)) node.fail(expected);
      for (int j = 0; j < dim; ++j)
        if (has_rows || i == j) stiffness(i, j) = row[has_rows ? j : 0];
    }
  }
  if (stiffness != stiffness.transpose() || stiffness.isZero(0) ||
      !(Eigen::SelfAdjointEigenSolver<Mat<3>>(stiffness).eigenvalues()[0] >= -1e-12 * stiffness.norm()))
    node.fail("a symmetric stiffness that is nowhere negative, and not 0");
  return stiffness;
}

/// Area of facets with these tags at rest, and their centroid.
template <int Dim>
std::pair<double, Vec<Dim>> area_of(const Mesh<Dim>& mesh, const std::vector<int>& tags) {
  double area = 0;
  Vec<Dim> moment = Vec<Dim>::Zero();
  for (const FacetId f : mesh.live_facets()) {
    if (std::ranges::find(tags, mesh.facet_tag(f)) == tags.end()) continue;
    Vec<Dim> middle = Vec<Dim>::Zero();
    for (const VertexId v : mesh.facet(f)) middle += mesh.rest(v) / Dim;
    const double part = facet_measure(mesh, f) * turn_at(mesh, middle);
    area += part;
    moment += part * middle;
  }
  return {area, moment / area};
}

template <int Dim>
Spring read_spring(const Node& node, const Sets& sets, const std::set<int>& with_facets, const Mesh<Dim>& mesh) {
  Spring spring{.surfaces = read_surfaces(node["id"], sets, with_facets, "the ids of the surfaces that the springs hold")};
  spring.name = read_curve_name(node, "spring");
  const Node total = node["stiffness"], by_area = node["stiffness_by_area"];
  if (total.exists() == by_area.exists())
    total.fail(total.exists() ? "a stiffness beside stiffness_by_area" : "nothing", "stiffness or stiffness_by_area");
  spring.stiffness = by_area.exists() ? read_stiffness(by_area, Dim)
                                      : Mat<3>(read_stiffness(total, Dim) / area_of(mesh, spring.surfaces).first);
  return spring;
}

/// Checks what prescribes components of a motion, which has no effect on others. `names` are those of the components.
void require_held(const Node& node, const std::array<bool, 3>& held, const std::vector<std::string>& names) {
  if (!node.exists()) return;
  if (held == std::array<bool, 3>{})
    node.fail(abbreviate(node.json()) + ", which has no effect",
              fmt::format("one of {} in `held` beside it", fmt::join(names, ", ")));
  const std::vector<Node> components = node.items();
  const std::size_t first = components.size() == 1 ? 2 : 0;  // a number is the turn about z
  for (std::size_t i = 0; i < components.size() && first + i < held.size(); ++i)
    if (!held[first + i] && components[i].json() != 0)
      components[i].fail(abbreviate(components[i].json()) + ", which has no effect",
                         fmt::format("0, or {} in `held` beside it", names[first + i]));
}

template <int Dim>
Coupling read_coupling(const Node& node, const Sets& sets, const std::set<int>& with_facets, const Setup<Dim>& setup) {
  Coupling coupling{.surfaces = read_surfaces(node["id"], sets, with_facets, "the ids of the surfaces of the point")};
  coupling.name = read_curve_name(node, "coupling");
  coupling.is_rigid = node["kind"].choice({"distributing", "rigid"}, 0) == 1;
  coupling.point.head<Dim>() = area_of(setup.mesh, coupling.surfaces).second;
  if (const Node point = node["point"]; point.exists()) {
    const std::vector<double> numbers = point.numbers();
    if (numbers.size() != Dim) point.fail(std::to_string(Dim) + " numbers");
    coupling.point.head<Dim>() = Eigen::Map<const Vec<Dim>>(numbers.data());
  }
  read_held(node["held"], Dim, coupling.held_position, coupling.held_rotation);
  require_held(node["motion"], coupling.held_position, {"x", "y", "z"});
  require_held(node["turn"], coupling.held_rotation, {"rx", "ry", "rz"});
  coupling.motion = read_vector<Dim>(node["motion"], setup.time, coupling.point);
  if (const FunctionOfTime turn = read_axial_vector(node["turn"], Dim, setup.time, coupling.point))
    coupling.turn = [turn](double t) { return Vec<3>(std::numbers::pi / 180 * turn(t)); };
  coupling.force = read_vector<Dim>(node["force"], setup.time, coupling.point);
  coupling.moment = read_axial_vector(node["moment"], Dim, setup.time, coupling.point);
  if (node.has("mass")) coupling.mass = node["mass"].positive(1);
  if (node.has("stiffness")) coupling.stiffness = read_stiffness(node["stiffness"], Dim);
  return coupling;
}

}  // namespace

std::string read_curve_name(const Node& node, const std::string& what) {
  const std::string name = node["name"].string(what + " " + text_of(read_label(node["id"].items().front(), 0)));
  if (name.empty() || name.find_first_of(",\"\n") != std::string::npos)
    node["name"].fail("a name without commas and quotes");
  return name;
}

std::vector<int> read_surfaces(const Node& node, const Sets& sets, const std::set<int>& with_facets,
                               const std::string& expected) {
  if (!node.exists()) node.fail(expected);
  std::set<int> tags;
  for (const Node& id : node.items()) {
    const std::size_t before = tags.size();
    for (const int tag : sets.surfaces.of(read_label(id, 0)))
      if (with_facets.contains(tag)) tags.insert(tag);
    if (tags.size() == before)
      id.fail(abbreviate(id.json()) + ", which no surface of a body has",
              "the id of one: " + sets.surfaces.list(&with_facets));
  }
  if (tags.empty()) node.fail(expected);
  return {tags.begin(), tags.end()};
}

template <int Dim>
void read_supports(const Node& root, const Sets& sets, Setup<Dim>& setup) {
  const std::set<int> with_facets = sets.facet_tags(setup.mesh);
  for (const Node& node : root["springs"].items())
    setup.nodal_loads.push_back(
        SpringEntry<Dim>{std::make_shared<const Spring>(read_spring(node, sets, with_facets, setup.mesh))});
  for (const Node& node : root["couplings"].items())
    setup.nodal_loads.push_back(
        CouplingEntry<Dim>{std::make_shared<const Coupling>(read_coupling(node, sets, with_facets, setup))});
}

template void read_supports(const Node&, const Sets&, Setup<2>&);
template void read_supports(const Node&, const Sets&, Setup<3>&);

}  // namespace itr::scene
