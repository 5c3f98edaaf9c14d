// SPDX-License-Identifier: MIT
#include <algorithm>
#include <set>

#include "mesh/facet_tags.hpp"
#include "readers.hpp"

namespace itr::scene {

namespace {

std::string read_name(const Node& node, const char* what) {
  const std::string name = node["name"].string("");
  if (name.empty()) node["name"].fail(what);
  if (name.find_first_of(",\"\n") != std::string::npos) node["name"].fail("a name without commas and quotes");
  return name;
}

/// Reads Dim numbers.
template <int Dim>
std::array<double, 3> read_place(const Node& node) {
  const std::vector<double> numbers = node.numbers();
  if (numbers.size() != Dim) node.fail(std::to_string(Dim) + " numbers");
  std::array<double, 3> place{};
  std::copy(numbers.begin(), numbers.end(), place.begin());
  return place;
}

template <int Dim>
class ForceReader {
 public:
  ForceReader(const PartNames& parts, const Sets& sets, const Mesh<Dim>& mesh)
      : parts_(parts), sets_(sets), facet_tags_(sets.facet_tags(mesh)) {}

  ForceTarget read(const Node& node) const {
    ForceTarget target;
    target.name = read_name(node, "the name of the curve");
    for (const Node& id : node["surfaces"].items()) add_new(surface(id), target.surfaces);
    for (const Node& id : node["bodies"].items()) add_new(body(id), target.bodies);
    std::set<int> vertices;
    for (const Node& id : node["obstacles"].items()) {
      const std::vector<int> of_id = obstacle(id);
      vertices.insert(of_id.begin(), of_id.end());
    }
    target.obstacle_vertices.assign(vertices.begin(), vertices.end());
    if (target.surfaces.empty() && target.bodies.empty() && vertices.empty())
      node.fail("no surfaces, bodies or obstacles", "at least one of them");
    if (const Node about = node["about"]; about.exists()) target.about = read_place<Dim>(about);
    return target;
  }

 private:
  static void add_new(const std::vector<int>& ids, std::vector<int>& to) {
    for (const int id : ids)
      if (std::find(to.begin(), to.end(), id) == to.end()) to.push_back(id);
  }

  std::vector<int> surface(const Node& node) const {
    const Label label = read_label(node, 0);
    std::vector<int> tags = sets_.surfaces.of(label);
    std::erase_if(tags, [&](int tag) { return !facet_tags_.contains(tag); });
    if (tags.empty()) sets_.surfaces.refuse(node, label, "the id of a surface: ");
    return tags;
  }

  std::vector<int> body(const Node& node) const {
    const Label label = read_label(node, 0);
    if (sets_.bodies.of(label).empty()) sets_.bodies.refuse(node, label, "the id of a body: ");
    return sets_.bodies.of(label);
  }

  std::vector<int> obstacle(const Node& node) const {
    std::vector<int> vertices = obstacle_vertices(parts_, sets_, read_label(node, 0));
    if (vertices.empty())
      node.fail(abbreviate(node.json()) + ", which nothing has",
                "the surface_selection of an obstacle, or its name: " + list_with_obstacles(parts_, sets_, {}));
    return vertices;
  }

  const PartNames& parts_;
  const Sets& sets_;
  std::set<int> facet_tags_;
};

/// Ids by names, and by numbers that stand for others than themselves.
std::map<std::string, std::vector<int>> ids_by_name(const LabelIds& labels) {
  std::map<std::string, std::vector<int>> names;
  for (const auto& [label, ids] : labels.all())
    if (!label.name.empty() || ids != std::vector{label.number}) names.emplace(text_of(label), ids);
  return names;
}

}  // namespace

std::vector<int> obstacle_vertices(const PartNames& parts, const Sets& sets, const Label& label) {
  if (const auto found = parts.obstacles.find(label.name); !label.name.empty() && found != parts.obstacles.end())
    return found->second;
  std::set<int> vertices;
  for (const int id : sets.surfaces.of(label))
    if (const auto found = parts.obstacles_by_id.find(id); found != parts.obstacles_by_id.end())
      vertices.insert(found->second.begin(), found->second.end());
  return {vertices.begin(), vertices.end()};
}

std::string list_with_obstacles(const PartNames& parts, const Sets& sets, std::set<int> ids) {
  std::string names;
  for (const auto& [id, vertices] : parts.obstacles_by_id) ids.insert(id);
  for (const auto& [name, vertices] : parts.obstacles)
    if (sets.surfaces.of({0, name}).empty()) names += ", \"" + name + "\"";
  return sets.surfaces.list(&ids, std::move(names));
}

template <int Dim>
PartNames name_parts(const Geometries& geometries, const ObstacleGeometry<Dim>& obstacles, const Sets& sets) {
  PartNames parts;
  parts.bodies = ids_by_name(sets.bodies);
  for (const Node& geometry : geometries.bodies) {
    const Node selection = geometry["volume_selection"];
    const std::string name = geometry["name"].string("");
    if (!name.empty() && selection.exists() && !selection.json().is_structured())
      parts.bodies.emplace(name, sets.bodies.of(read_label(selection, 0)));
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
  for (auto& [name, ids] : ids_by_name(sets.surfaces)) {
    for (const int id : ids)
      if (const auto found = parts.obstacles_by_id.find(id); found != parts.obstacles_by_id.end())
        parts.obstacles.emplace(name, found->second);
    parts.surfaces.emplace(name, ids);
  }
  return parts;
}

template <int Dim>
std::vector<ForceTarget> read_forces(const Node& root, const PartNames& parts, const Sets& sets, const Mesh<Dim>& mesh) {
  const ForceReader<Dim> reader(parts, sets, mesh);
  std::vector<ForceTarget> targets;
  std::set<std::string> names;
  for (const Node& node : root["output"]["forces"].items()) {
    targets.push_back(reader.read(node));
    if (!names.insert(targets.back().name).second) node["name"].fail("a name that no entry before it has");
  }
  return targets;
}

template <int Dim>
std::vector<PointTarget> read_points(const Node& root) {
  std::vector<PointTarget> targets;
  std::set<std::string> names;
  for (const Node& node : root["output"]["points"].items()) {
    targets.push_back({read_name(node, "the name of the point"), read_place<Dim>(node["rest"])});
    if (!names.insert(targets.back().name).second) node["name"].fail("a name that no entry before it has");
  }
  return targets;
}

#define ITR_INSTANTIATE(Dim)                                                                   \
  template std::vector<PointTarget> read_points<Dim>(const Node&);                             \
  template PartNames name_parts(const Geometries&, const ObstacleGeometry<Dim>&, const Sets&); \
  template std::vector<ForceTarget> read_forces(const Node&, const PartNames&, const Sets&, const Mesh<Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr::scene
