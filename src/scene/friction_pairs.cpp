// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <set>

#include "readers.hpp"

namespace itr::scene {

namespace {

template <int Dim>
class PairReader {
 public:
  PairReader(const PartNames& parts, const Sets& sets, const Mesh<Dim>& mesh)
      : parts_(parts), sets_(sets), facet_tags_(sets.facet_tags(mesh)) {}

  FrictionPair read(const Node& node) const {
    FrictionPair pair{side(node["a"]), side(node["b"])};
    const Node both = node["coefficient"], statics = node["static"], kinetic = node["kinetic"];
    if (both.exists() == statics.exists()) node.fail(abbreviate(node.json()), "one of coefficient and static");
    if (both.exists() && kinetic.exists()) kinetic.fail("static beside kinetic, not coefficient");
    pair.statics = both.exists() ? both.non_negative(0) : statics.non_negative(0);
    pair.kinetic = kinetic.non_negative(pair.statics);
    if (pair.kinetic > pair.statics)
      kinetic.fail(
          fmt::format("at most the static coefficient, {}: friction that grows with speed is not supported", pair.statics));
    return pair;
  }

 private:
  FrictionSide side(const Node& node) const {
    if (!node.exists()) node.fail("the id or the name of a body, a surface or an obstacle");
    const Label label = read_label(node, 0);
    FrictionSide side;
    side.bodies = sets_.bodies.of(label);
    if (const auto found = parts_.bodies.find(label.name); !label.name.empty() && found != parts_.bodies.end())
      side.bodies = found->second;
    side.surfaces = sets_.surfaces.of(label);
    side.obstacle_vertices = obstacle_vertices(parts_, sets_, label);
    std::erase_if(side.surfaces, [&](int tag) { return !facet_tags_.contains(tag); });
    const bool is_surface = !side.surfaces.empty() || !side.obstacle_vertices.empty();
    if (!side.bodies.empty() && is_surface)
      node.fail(abbreviate(node.json()) + ", which is a body's and a surface's",
                "a name or a number that only one of them has");
    if (side.bodies.empty() && !is_surface) refuse(node, label);
    return side;
  }

  [[noreturn]] void refuse(const Node& node, const Label& label) const {
    std::set<std::string> names;
    for (const auto* all : {&parts_.bodies, &parts_.surfaces, &parts_.obstacles})
      for (const auto& [name, ids] : *all) names.insert(name);
    const std::string near = nearest_name(label.name, {names.begin(), names.end()});
    node.fail(abbreviate(node.json()) + ", which nothing has",
              (near.empty() ? "" : "\"" + near + "\" perhaps; ") + "a body: " + sets_.bodies.list() +
                  "; or a surface or an obstacle: " + list_with_obstacles(parts_, sets_, facet_tags_));
  }

  const PartNames& parts_;
  const Sets& sets_;
  std::set<int> facet_tags_;
};

}  // namespace

template <int Dim>
std::vector<FrictionPair> read_friction_pairs(const Node& root, const PartNames& parts, const Sets& sets,
                                              const Mesh<Dim>& mesh) {
  const Node list = root["contact"]["friction_pairs"];
  const PairReader<Dim> reader(parts, sets, mesh);
  std::vector<FrictionPair> pairs;
  for (const Node& node : list.items()) pairs.push_back(reader.read(node));
  if (pairs.size() > kMostFrictionPairs) list.fail(fmt::format("at most {} pairs", kMostFrictionPairs));
  return pairs;
}

#define ITR_INSTANTIATE(Dim) \
  template std::vector<FrictionPair> read_friction_pairs(const Node&, const PartNames&, const Sets&, const Mesh<Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr::scene
