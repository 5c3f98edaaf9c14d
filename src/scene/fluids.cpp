// SPDX-License-Identifier: MIT
#include "fluids.hpp"

#include "supports.hpp"

namespace itr::scene {

std::optional<Fluid> read_fluid(const Node& node, const std::vector<int>& tags, const Sets& sets,
                                const std::set<int>& with_facets, std::span<const Fluid> others) {
  if (!node["penetrates"].boolean(false)) {
    for (const char* key : {"from", "leaks_to", "critical_pressure"})
      if (node.has(key)) node[key].fail("it without a fluid", "\"penetrates\": true beside it");
    return std::nullopt;
  }
  Fluid fluid{.place = node.pointer()};
  for (const int tag : tags)
    if (const auto found = sets.surfaces.wet().find(tag); found != sets.surfaces.wet().end()) fluid.wet.insert(*found);
  for (const Fluid& other : others)
    for (const auto& [before, wet] : other.wet)
      if (fluid.wet.contains(before))
        node["id"].fail(abbreviate(node["id"].json()) + ", of which the fluid of " + other.place + " has a part",
                        "one fluid on a surface");
  const auto surfaces = [&](const char* key, const char* expected) {
    return node.has(key) ? read_surfaces(node[key], sets, with_facets, expected) : std::vector<int>();
  };
  fluid.from = surfaces("from", "the surface that the fluid comes from");
  fluid.leaks_to = surfaces("leaks_to", "the surface that the fluid leaks to");
  if (node.has("critical_pressure")) fluid.critical_pressure = node["critical_pressure"].positive(1);
  return fluid;
}

}  // namespace itr::scene
