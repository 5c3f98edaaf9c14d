// SPDX-License-Identifier: MIT
#include <algorithm>
#include <limits>
#include <set>

#include "function.hpp"
#include "readers.hpp"
#include "rigid.hpp"
#include "supports.hpp"

namespace itr::scene {

/// A jump with components that are "free", which are NaN.
template <int Dim>
std::function<Vec<3>(double)> read_free_jump(const std::vector<Node>& items) {
  std::vector<std::function<double(const Vec<Dim>&, double)>> components;
  for (const Node& item : items) {
    const bool is_free = item.json() == "free";
    components.push_back(is_free ? nullptr : read_scalar_function<Dim>(item, item["no such key"]).function);
  }
  return [components](double t) {
    Vec<3> jump = Vec<3>::Zero();
    for (int c = 0; c < Dim; ++c) {
      const auto& component = components[static_cast<std::size_t>(c)];
      jump[c] = component ? component(Vec<Dim>::Zero(), t) : std::numeric_limits<double>::quiet_NaN();
    }
    return jump;
  };
}

template <int Dim>
std::function<Vec<3>(double)> read_jump(const Node& node, const TimeOptions& time) {
  const Node jump = node["jump"];
  if (!node["periodic"].boolean(false)) {
    if (jump.exists()) jump.fail(abbreviate(jump.json()) + ", which has no effect", "\"periodic\": true beside it");
    return {};
  }
  const std::vector<Node> items = jump.items();
  if (std::ranges::any_of(items, [](const Node& item) { return item.json() == "free"; })) {
    if (items.size() != Dim) jump.fail(std::to_string(Dim) + " numbers, expressions or \"free\"");
    return read_free_jump<Dim>(items);
  }
  if (auto function = read_vector<Dim>(jump, time, Vec<3>::Zero())) return function;
  return [](double) { return Vec<3>(Vec<3>::Zero()); };
}

template <int Dim>
std::vector<Tie> read_ties(const Node& root, const Sets& sets, const Mesh<Dim>& mesh, const TimeOptions& time) {
  const std::set<int> with_facets = sets.facet_tags(mesh);
  const auto read_side = [&](const Node& node) {
    return read_surfaces(node, sets, with_facets, "the ids of the surfaces on this side of the tie");
  };
  std::vector<Tie> ties;
  for (const Node& node : root["ties"].items()) {
    const Tie& tie = ties.emplace_back(Tie{read_side(node["a"]), read_side(node["b"]), read_jump<Dim>(node, time)});
    for (const int tag : tie.a)
      if (std::ranges::find(tie.b, tag) != tie.b.end())
        node["b"].fail(abbreviate(node["b"].json()) + ", which side a has too", "surfaces of two sides");
  }
  return ties;
}

#define ITR_INSTANTIATE(Dim) \
  template std::vector<Tie> read_ties(const Node&, const Sets&, const Mesh<Dim>&, const TimeOptions&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr::scene
