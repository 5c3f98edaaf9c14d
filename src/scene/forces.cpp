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
  ForceReader(const PartNames& parts, const Mesh<Dim>& mesh) : parts_(parts), mesh_(mesh) {}

  ForceTarget read(const Node& node) const {
    ForceTarget target;
    target.name = node["name"].string("");
    if (target.name.empty()) node["name"].fail("the name of the curve");
    if (target.name.find_first_of(",\"\n") != std::string::npos) node["name"].fail("a name without commas and quotes");
    for (const Node& id : node["surfaces"].items()) target.surfaces.push_back(surface(id));
    for (const Node& id : node["bodies"].items()) target.bodies.push_back(body(id));
    std::set<int> vertices;
    for (const Node& id : node["obstacles"].items()) {
      const std::vector<int>& of_id = obstacle(id);
      vertices.insert(of_id.begin(), of_id.end());
    }
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
    if (node.json().is_string()) return named(node, parts_.bodies, "of a geometry whose volume_selection is a number");
    std::set<int> ids;
    for (CellId c = 0; c < mesh_.cell_slots(); ++c) ids.insert(mesh_.body(c));
    const int id = read_id(node, 0);
    if (!ids.contains(id)) refuse(node, "the id of a body", ids);
    return id;
  }

  const std::vector<int>& obstacle(const Node& node) const {
    if (node.json().is_string()) return named(node, parts_.obstacles, "of an obstacle");
    const auto found = parts_.obstacles_by_id.find(read_id(node, 0));
    if (found != parts_.obstacles_by_id.end()) return found->second;
    std::set<int> ids;
    for (const auto& [id, vertices] : parts_.obstacles_by_id) ids.insert(id);
    refuse(node, "the surface_selection of an obstacle, or its name", ids);
  }

  template <typename Part>
  static const Part& named(const Node& node, const std::map<std::string, Part>& parts, const char* of) {
    const auto found = parts.find(node.string(""));
    if (found != parts.end()) return found->second;
    std::string names;
    for (const auto& [name, part] : parts) names += (names.empty() ? "" : ", ") + name;
    node.fail(abbreviate(node.json()) + ", which is no /geometry/*/name " + of,
              names.empty() ? "an id: there are no names" : names);
  }

  const PartNames& parts_;
  const Mesh<Dim>& mesh_;
};

}  // namespace

template <int Dim>
PartNames name_parts(const Geometries& geometries, const ObstacleGeometry<Dim>& obstacles) {
  PartNames parts;
  for (const Node& geometry : geometries.bodies) {
    const Node selection = geometry["volume_selection"];
    const std::string name = geometry["name"].string("");
    if (!name.empty() && selection.exists() && selection.json().is_number())
      parts.bodies.emplace(name, read_id(selection, 0));
  }
  std::map<std::string, std::size_t> first;
  for (std::size_t i = 0; i < geometries.obstacles.size(); ++i)
    if (const std::string name = geometries.obstacles[i]["name"].string(""); !name.empty()) first.emplace(name, i);
  for (const auto& [name, part] : first) {
    std::vector<int>& vertices = parts.obstacles[name];
    for (std::size_t v = 0; v < obstacles.part.size(); ++v)
      if (obstacles.part[v] == static_cast<int>(part)) vertices.push_back(static_cast<int>(v));
  }
  for (std::size_t v = 0; v < obstacles.id.size(); ++v)
    if (obstacles.id[v] != kNoTag) parts.obstacles_by_id[obstacles.id[v]].push_back(static_cast<int>(v));
  return parts;
}

template <int Dim>
std::vector<ForceTarget> read_forces(const Node& root, const PartNames& parts, const Mesh<Dim>& mesh) {
  const ForceReader<Dim> reader(parts, mesh);
  std::vector<ForceTarget> targets;
  std::set<std::string> names;
  for (const Node& node : root["output"]["forces"].items()) {
    targets.push_back(reader.read(node));
    if (!names.insert(targets.back().name).second) node["name"].fail("a name that no entry before it has");
  }
  return targets;
}

#define ITR_INSTANTIATE(Dim)                                                      \
  template PartNames name_parts(const Geometries&, const ObstacleGeometry<Dim>&); \
  template std::vector<ForceTarget> read_forces(const Node&, const PartNames&, const Mesh<Dim>&);
ITR_INSTANTIATE(2)
ITR_INSTANTIATE(3)
#undef ITR_INSTANTIATE

}  // namespace itr::scene
