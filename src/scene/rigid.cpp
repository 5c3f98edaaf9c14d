// SPDX-License-Identifier: MIT
#include "rigid.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>

#include "energy/rigid_body.hpp"
#include "function.hpp"

namespace itr::scene {

namespace {

template <int Dim>
struct Volume {
  double volume = 0;
  Vec<Dim> centre = Vec<Dim>::Zero();
};

template <int Dim>
Volume<Dim> volume_of(const Mesh<Dim>& mesh, const std::vector<int>& bodies) {
  Volume<Dim> sum;
  for (const CellId c : mesh.live_cells()) {
    if (std::ranges::find(bodies, mesh.body(c)) == bodies.end()) continue;
    sum.volume += mesh.volume(c);
    sum.centre += mesh.volume(c) * mesh.barycenter(c);
  }
  sum.centre /= sum.volume;
  return sum;
}

/// Times at which loads have to have a value.
std::vector<double> sampled_times(const TimeOptions& time) {
  const double end = time.is_static ? time.t0 + 1 : time.t0 + time.dt * time.steps;
  return {time.t0, (time.t0 + end) / 2, end};
}

}  // namespace

void read_held(const Node& node, int dim, std::array<bool, 3>& position, std::array<bool, 3>& rotation) {
  static const std::vector<std::string> names = {"x", "y", "z", "rx", "ry", "rz"};
  for (const Node& name : node.items()) {
    const int index = name.choice(names, 0);
    if (dim == 2 && index > 1 && index < 5) name.fail(abbreviate(name.json()) + " in a plane", "x, y or rz");
    (index < 3 ? position[index] : rotation[index - 3]) = true;
  }
}

template <int Dim>
FunctionOfTime read_vector(const Node& node, const TimeOptions& time, const Vec<3>& about) {
  if (!node.exists()) return {};
  if (node.items().size() != Dim) node.fail(std::to_string(Dim) + " numbers or expressions");
  const Vec<Dim> X = about.head<Dim>();
  const ValueFunction<Dim> value = read_function<Dim>(node);
  check_defined<Dim>(value.function, {X}, sampled_times(time), node);
  if (value.is_zero) return {};
  return [f = value.function, X](double t) {
    Vec<3> load = Vec<3>::Zero();
    load.head<Dim>() = f(X, t);
    return load;
  };
}

FunctionOfTime read_axial_vector(const Node& node, int dim, const TimeOptions& time, const Vec<3>& about) {
  if (!node.exists()) return {};
  if (dim == 3) {
    if (!node.json().is_array() || node.items().size() != 3) node.fail("three numbers or expressions");
    return read_vector<3>(node, time, about);
  }
  if (node.json().is_array()) node.fail("a number or an expression: that about z");
  const ScalarFunction<3> value = read_scalar_function<3>(node, node["interpolation"]);
  for (const double t : sampled_times(time)) value.function(about, t);
  if (value.is_zero) return {};
  return [f = value.function, about](double t) { return Vec<3>(0, 0, f(about, t)); };
}

bool is_rigid(const Node& geometry) { return geometry.has("rigid") && geometry["enabled"].boolean(true); }

Label rigid_label(const Node& geometry) {
  const std::string name = geometry["name"].string("");
  const std::vector<Node> all = Node(geometry.document())["geometry"].items();
  const auto has_name = [&](const Node& other) { return other["name"].string("") == name; };
  if (!name.empty() && std::ranges::count_if(all, has_name) == 1) return {0, name};
  const std::string pointer = geometry.pointer(), place = pointer.substr(pointer.rfind('/') + 1);
  return {0, "rigid body " + (std::isdigit(static_cast<unsigned char>(place[0])) ? place : "0")};
}

MeshFile filled_surface(const Node& geometry, const MeshFile& surface) {
  constexpr double kRoundOff = 1e-9;  // of the volume
  const Node mesh = geometry["mesh"];
  std::map<std::pair<int, int>, int> edges;  // times that triangles go along them this way, less those the other way
  for (const auto& t : surface.triangles)
    for (int i = 0; i < 3; ++i) {
      const auto [a, b] = std::minmax(t[i], t[(i + 1) % 3]);
      edges[{a, b}] += t[i] == a ? 1 : -1;
    }
  if (std::ranges::any_of(edges, [](const auto& edge) { return edge.second != 0; }))
    mesh.fail("a surface that does not close, or whose triangles face both ways", "tetrahedra, or a closed surface");
  const auto volume_at = [&](const std::array<int, 3>& t, const Vec<3>& from) {
    const auto arm = [&](int i) { return Vec<3>(surface.vertices[t[i]] - from); };
    return arm(0).dot(arm(1).cross(arm(2))) / 6;
  };
  const Vec<3> first = surface.vertices[surface.triangles[0][0]];
  double volume = 0;
  Vec<3> moment = Vec<3>::Zero();
  for (const auto& t : surface.triangles) {
    const double part = volume_at(t, first);
    volume += part;
    moment += part / 4 * (surface.vertices[t[0]] + surface.vertices[t[1]] + surface.vertices[t[2]] - 3 * first);
  }
  const Vec<3> centroid = first + moment / volume;
  MeshFile filled = surface;
  filled.vertices.push_back(centroid);
  const int apex = static_cast<int>(surface.vertices.size());
  for (const auto& t : surface.triangles) {
    if (!(volume_at(t, centroid) / volume > kRoundOff / static_cast<double>(surface.triangles.size())))
      mesh.fail("a surface that is not seen whole from its centroid", "tetrahedra: it cannot be filled from there");
    filled.tetrahedra.push_back(volume > 0 ? std::array{t[0], t[1], t[2], apex} : std::array{t[1], t[0], t[2], apex});
  }
  filled.tetrahedron_body.assign(filled.tetrahedra.size(), 0);
  return filled;
}

std::set<int> rigid_ids(const Node& root, const LabelIds& bodies) {
  std::set<int> ids;
  for (const Node& geometry : root["geometry"].items()) {
    if (!is_rigid(geometry)) continue;
    const std::vector<int>& of_body = bodies.of(rigid_label(geometry));
    ids.insert(of_body.begin(), of_body.end());
  }
  return ids;
}

template <int Dim>
void read_rigid_bodies(const Node& root, const LabelIds& bodies, Setup<Dim>& setup) {
  for (const Node& geometry : root["geometry"].items()) {
    if (!is_rigid(geometry)) continue;
    const Node node = geometry["rigid"];
    const std::vector<int>& ids = bodies.of(rigid_label(geometry));
    const Volume<Dim> volume = volume_of(setup.mesh, ids);
    if (node.has("mass") && node.has("density")) node["density"].fail("a mass and a density", "one of them");
    if (setup.time.has_inertia() && !node.has("mass") && !node.has("density"))
      node["mass"].fail("a mass or a density, which dynamics needs");
    constexpr double kFarthest = 1e4;
    const auto body = std::make_shared<RigidBody>();
    body->about.head<Dim>() = volume.centre;
    const Vec<3> centre = body->about;
    if (const Node about = node["about"]; about.exists()) {
      const std::vector<double> numbers = about.numbers();
      if (numbers.size() != Dim) about.fail(std::to_string(Dim) + " numbers");
      body->about.head<Dim>() = Eigen::Map<const Vec<Dim>>(numbers.data());
      const double size = std::pow(volume.volume, 1.0 / Dim);
      if (!((body->about - centre).stableNorm() <= kFarthest * size))
        about.fail(abbreviate(about.json()) + ", from where round-off hides the body's turn",
                   fmt::format("a point at most {:g} times the body's size from it", kFarthest));
    }
    read_held(node["held"], Dim, body->held_position, body->held_rotation);
    body->force = read_vector<Dim>(node["force"], setup.time, body->about);
    body->moment = read_axial_vector(node["moment"], Dim, setup.time, body->about);
    Material material;
    material.law = MaterialLaw::saint_venant_kirchhoff;
    material.youngs_modulus = 1;  // Setup::choose_defaults knows the others
    material.poisson_ratio = 0;
    material.density = 0;
    if (node.has("density")) material.density = node["density"].positive(1);
    if (node.has("mass")) material.density = node["mass"].positive(1) / volume.volume;
    material.own = body;
    for (const int id : ids) {
      setup.materials[id] = material;
      setup.order.erase(id);
    }
  }
}

template FunctionOfTime read_vector<2>(const Node&, const TimeOptions&, const Vec<3>&);
template FunctionOfTime read_vector<3>(const Node&, const TimeOptions&, const Vec<3>&);
template void read_rigid_bodies(const Node&, const LabelIds&, Setup<2>&);
template void read_rigid_bodies(const Node&, const LabelIds&, Setup<3>&);

}  // namespace itr::scene
