// SPDX-License-Identifier: MIT
#include "forces.hpp"

#include <algorithm>
#include <set>

#include "selection.hpp"

namespace itr::scene {

namespace {

template <int Dim>
class ForceReader {
 public:
  ForceReader(const Geometries& geometries, const ObstacleGeometry<Dim>& obstacles, const Mesh<Dim>& mesh)
      : geometries_(geometries), obstacles_(obstacles), mesh_(mesh) {}

  ForceTarget read(const Node& node) const {
    ForceTarget target;
    target.name = node["name"].string("");
    if (target.name.empty()) node["name"].fail("the name of the curve");
    if (target.name.find_first_of(",\"\n") != std::string::npos) node["name"].fail("a name without commas and quotes");
    for (const Node& id : node["surfaces"].items()) target.surfaces.push_back(surface(id));
    for (const Node& id : node["bodies"].items()) target.bodies.push_back(body(id));
    std::set<int> vertices;
    for (const Node& id : node["obstacles"].items()) vertices.merge(obstacle(id));
    target.obstacle_vertices.assign(vertices.begin(), vertices.end());
    if (target.surfaces.empty() && target.bodies.empty() && vertices.empty())
      node.fail("no surfaces, bodies or obstacles", "at least one of them");
    if (const Node about = node["about"]; about.exists()) {
      const std::vector<double> point = about.numbers();
      if (point.size() != Dim) about.fail(std::to_string(Dim) + " numbers");
      std::copy(point.begin(), point.end(), target.about.begin());
    }
    return target;
  }

 private:
  [[noreturn]] static void refuse(const Node& node, const char* what, const std::set<int>& ids) {
    node.fail(abbreviate(node.json()) + ", which nothing has",
              std::string(what) + ": " + list_ids(std::vector<int>(ids.begin(), ids.end())));
  }

  int surface(const Node& node) const {
    std::set<int> ids;
    for (FacetId f = 0; f < mesh_.facet_slots(); ++f)
      if (mesh_.facet_tag(f) != kNoTag) ids.insert(mesh_.facet_tag(f));
    const int id = read_id(node, 0);
    if (!ids.contains(id)) refuse(node, "the id of a surface_selection", ids);
    return id;
  }

  int body(const Node& node) const {
    if (node.json().is_string()) {
      const Node selection = named(node, geometries_.bodies)["volume_selection"];
      if (!selection.exists() || !selection.json().is_number())
        node.fail("the name of a geometry whose volume_selection is a number, or an id");
      return read_id(selection, 0);
    }
    std::set<int> ids;
    for (CellId c = 0; c < mesh_.cell_slots(); ++c) ids.insert(mesh_.body(c));
    const int id = read_id(node, 0);
    if (!ids.contains(id)) refuse(node, "the id of a body", ids);
    return id;
  }

  std::set<int> obstacle(const Node& node) const {
    std::set<int> vertices;
    if (node.json().is_string()) {
      const std::string pointer = named(node, geometries_.obstacles).pointer();
      for (std::size_t i = 0; i < geometries_.obstacles.size(); ++i)
        if (geometries_.obstacles[i].pointer() == pointer) take(obstacles_.part, static_cast<int>(i), vertices);
      return vertices;
    }
    take(obstacles_.id, read_id(node, 0), vertices);
    std::set<int> ids(obstacles_.id.begin(), obstacles_.id.end());
    ids.erase(kNoTag);
    if (vertices.empty()) refuse(node, "the surface_selection of an obstacle, or its name", ids);
    return vertices;
  }

  static void take(const std::vector<int>& keys, int key, std::set<int>& vertices) {
    for (std::size_t v = 0; v < keys.size(); ++v)
      if (keys[v] == key) vertices.insert(static_cast<int>(v));
  }

  static const Node& named(const Node& node, const std::vector<Node>& geometries) {
    std::string names;
    for (const Node& geometry : geometries) {
      const std::string name = geometry["name"].string("");
      if (name == node.string("")) return geometry;
      if (!name.empty()) names += (names.empty() ? "" : ", ") + name;
    }
    node.fail(abbreviate(node.json()) + ", which no /geometry/*/name is",
              names.empty() ? "an id: there are no names" : names);
  }

  const Geometries& geometries_;
  const ObstacleGeometry<Dim>& obstacles_;
  const Mesh<Dim>& mesh_;
};

}  // namespace

template <int Dim>
std::vector<ForceTarget> read_forces(const Node& root, const Geometries& geometries, const ObstacleGeometry<Dim>& obstacles,
                                     const Mesh<Dim>& mesh) {
  const ForceReader<Dim> reader(geometries, obstacles, mesh);
  std::vector<ForceTarget> targets;
  std::set<std::string> names;
  for (const Node& node : root["output"]["forces"].items()) {
    targets.push_back(reader.read(node));
    if (!names.insert(targets.back().name).second) node["name"].fail("a name that no entry before it has");
  }
  return targets;
}

template std::vector<ForceTarget> read_forces(const Node&, const Geometries&, const ObstacleGeometry<2>&, const Mesh<2>&);
template std::vector<ForceTarget> read_forces(const Node&, const Geometries&, const ObstacleGeometry<3>&, const Mesh<3>&);

}  // namespace itr::scene
