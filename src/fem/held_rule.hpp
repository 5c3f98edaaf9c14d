// SPDX-License-Identifier: MIT
// The rule by which Dirichlet conditions hold vertices and the nodes of curved edges.
#pragma once

#include <algorithm>
#include <array>
#include <map>

#include "itr/mesh.hpp"

namespace itr {

/// Whether a facet has all of these vertices.
template <std::size_t M, std::size_t N>
bool has_all(const std::array<VertexId, M>& facet, const std::array<VertexId, N>& vertices) {
  const auto is_of_facet = [&](VertexId v) { return std::find(facet.begin(), facet.end(), v) != facet.end(); };
  return std::all_of(vertices.begin(), vertices.end(), is_of_facet);
}

/// Calls f(tag) for each boundary facet that has all of these vertices.
template <int Dim, std::size_t N, typename F>
void for_each_facet_tag(const Mesh<Dim>& mesh, const std::array<VertexId, N>& vertices, const F& f) {
  for (const FacetId facet : mesh.facets_of(vertices[0]))
    if (has_all(mesh.facet(facet), vertices)) f(mesh.facet_tag(facet));
}

/// Tells by which conditions a node is held, from the components that the condition of each tag holds. In each component
/// the condition of the node's own tag counts, else that of the largest tag among its facets.
template <int Dim>
class HeldRule {
 public:
  using Components = std::map<int, std::array<bool, Dim>>;  ///< by tag
  using Tags = std::array<int, Dim>;                        ///< that of the condition that counts, kNoTag in free components

  /// Keeps a reference to `components`.
  explicit HeldRule(const Components& components) : components_(components) {}

  /// Tags at a vertex, or at the node of the edge between two: facets at the edge hold it, and on the surface the tag of
  /// both ends. `mesh` is a Mesh, or what has its vertex_tag and for_each_facet_tag.
  template <typename View, std::size_t N>
  Tags tags_at(const View& mesh, const std::array<VertexId, N>& ends) const {
    Tags tags;
    tags.fill(kNoTag);
    if (components_.empty()) return tags;
    bool may_own = N == 1;
    for_each_facet_tag(mesh, ends, [&](int tag) {
      may_own = true;
      hold(tag, tags, [tag](int other) { return other == kNoTag || tag > other; });
    });
    const int own = mesh.vertex_tag(ends[0]);
    if (may_own && own == mesh.vertex_tag(ends[N - 1])) hold(own, tags, [](int) { return true; });
    return tags;
  }
  Tags tags_of_node(const Mesh<Dim>& mesh, VertexId node) const {
    const EdgeKey edge = mesh.edge_of_node(node);
    return edge[0] == kNone ? tags_at(mesh, std::array{node}) : tags_at(mesh, edge);
  }

 private:
  template <typename Wins>
  void hold(int tag, Tags& tags, const Wins& wins) const {
    const auto it = tag == kNoTag ? components_.end() : components_.find(tag);
    if (it == components_.end()) return;
    for (int c = 0; c < Dim; ++c)
      if (it->second[c] && wins(tags[c])) tags[c] = tag;
  }

  const Components& components_;
};

}  // namespace itr
