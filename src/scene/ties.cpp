// SPDX-License-Identifier: MIT
#include <algorithm>
#include <set>

#include "readers.hpp"
#include "supports.hpp"

namespace itr::scene {

template <int Dim>
std::vector<Tie> read_ties(const Node& root, const Sets& sets, const Mesh<Dim>& mesh) {
  const std::set<int> with_facets = sets.facet_tags(mesh);
  const auto read_side = [&](const Node& node) {
    return read_surfaces(node, sets, with_facets, "the ids of the surfaces on this side of the tie");
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
