// SPDX-License-Identifier: MIT
#include <algorithm>
#include <set>

#include "mesh/facet_tags.hpp"
#include "readers.hpp"

namespace itr::scene {

template <int Dim>
std::vector<Tie> read_ties(const Node& root, const Sets& sets, const Mesh<Dim>& mesh) {
  const std::set<int> with_facets = facet_tags(mesh);
  const auto read_side = [&](const Node& node) {
    if (!node.exists()) node.fail("the ids of the surfaces on this side of the tie");
    std::set<int> tags;
    for (const Node& id : node.items()) {
      const std::size_t before = tags.size();
      for (const int tag : sets.surfaces.of(read_label(id, 0)))
        if (with_facets.contains(tag)) tags.insert(tag);
      if (tags.size() == before)
        id.fail(abbreviate(id.json()) + ", which no surface of a body has",
                "the id of one: " + sets.surfaces.list(&with_facets));
    }
    if (tags.empty()) node.fail("the ids of the surfaces on this side of the tie");
    return std::vector<int>(tags.begin(), tags.end());
  };
  std::vector<Tie> ties;
  for (const Node& node : root["ties"].items()) {
    const Tie& tie = ties.emplace_back(Tie{read_side(node["a"]), read_side(node["b"])});
    for (const int tag : tie.a)
      if (std::ranges::find(tie.b, tag) != tie.b.end())
        node["b"].fail(abbreviate(node["b"].json()) + ", which side a has too", "surfaces of two sides");
  }
  return ties;
}

#define ITR_INSTANTIATE(Dim) template std::vector<Tie> read_ties(const Node&, const Sets&, const Mesh<Dim>&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr::scene
