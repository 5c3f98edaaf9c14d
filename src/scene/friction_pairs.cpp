// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <array>
#include <cmath>
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
    if (!pair.a.obstacle_vertices.empty() && pair.a.surfaces.empty() && !pair.b.obstacle_vertices.empty() &&
        pair.b.surfaces.empty())
      node["b"].fail(abbreviate(node["b"].json()) + ", an obstacle as a is",
                     "a body or its surface: obstacles alone never slide");
    const Node both = node["coefficient"], statics = node["static"], kinetic = node["kinetic"];
    if (both.exists() == statics.exists()) node.fail(abbreviate(node.json()), "one of coefficient and static");
    if (both.exists() && kinetic.exists()) kinetic.fail("static beside kinetic, not coefficient");
    const Two most = read_coefficients(both.exists() ? both : statics);
    const Two slides = kinetic.exists() ? read_coefficients(kinetic) : most;
    for (int i = 0; i < 2; ++i)
      if (slides[i] > most[i])
        kinetic.fail(
            fmt::format("at most the static coefficient, {}: friction that grows with speed is not supported", most[i]));
    pair.statics = most[0];
    pair.kinetic = slides[0];
    if (most[0] != most[1] || slides[0] != slides[1]) {
      const double off = std::abs(slides[0] * most[1] - slides[1] * most[0]);
      if (off > kSameRatio * most[0] * most[1])
        kinetic.fail(fmt::format("kinetic by static as the same ratio in both directions, such as [{0:g}, {1:g}]", slides[0],
                                 slides[0] / most[0] * most[1]));
      pair.across = read_across(node, most[1], slides[1], pair);
    } else {
      for (const char* key : {"direction", "frame"})
        if (node.has(key)) node[key].fail("two coefficients that differ, [along, across], for it to act");
    }
    return pair;
  }

 private:
  using Two = std::array<double, 2>;  ///< along and across
  static constexpr double kSameRatio = 1e-3;

  static Two read_coefficients(const Node& node) {
    if (!node.json().is_array()) return {node.non_negative(0), node.non_negative(0)};
    const std::vector<Node> items = node.items();
    if (items.size() != 2) node.fail("a number, or two: along a direction and across it");
    const Two two{items[0].non_negative(0), items[1].non_negative(0)};
    if (Dim == 2 && two[0] != two[1]) node.fail("one coefficient: in the plane, surfaces slide along one line only");
    return two;
  }

  FrictionAcross read_across(const Node& node, double statics, double kinetic, const FrictionPair& pair) const {
    FrictionAcross across{.statics = statics, .kinetic = kinetic};
    const Node direction = node["direction"], frame = node["frame"];
    if (!direction.exists()) node.fail("two coefficients without a direction", "the direction [x, y, z] of the first one");
    const std::vector<double> components = direction.numbers();
    if (components.size() != 3) direction.fail("three components");
    across.direction = Vec<3>(components[0], components[1], components[2]);
    if (!(across.direction.stableNorm() > 0)) direction.fail("a direction of length > 0");
    across.direction.stableNormalize();
    if (!frame.exists() || frame.json() == "space") return across;
    const FrictionSide turns = side(frame);
    if (turns == pair.a && turns == pair.b) frame.fail("space: both sides are the same, and turn apart");
    if (turns != pair.a && turns != pair.b)
      frame.fail(abbreviate(frame.json()), "space, or what a or b says: its surface turns the direction");
    across.frame = turns == pair.a ? FrictionAcross::Frame::a : FrictionAcross::Frame::b;
    return across;
  }

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
