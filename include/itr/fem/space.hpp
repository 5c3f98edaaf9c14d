// SPDX-License-Identifier: MIT
// The finite-element space on a mesh of straight rest cells. Each vertex is a node. A curved edge carries one more node, at
// its midpoint at rest; on a straight edge fields are linear. All edges curved is P2, none is P1, and every mixture is
// conforming, since cells that share an edge agree about it.
#pragma once

#include <map>
#include <vector>

#include "itr/mesh/mesh.hpp"

namespace itr {

/// Which edges of a compact mesh are curved. Nodes are the vertices, then the curved edges' nodes in the edges' order.
class Space {
 public:
  Space() = default;  ///< all edges straight
  /// `curved`: ascending, each once.
  explicit Space(std::vector<EdgeKey> curved) : curved_(std::move(curved)) {}

  bool is_linear() const { return curved_.empty(); }
  int num_curved() const { return static_cast<int>(curved_.size()); }
  const std::vector<EdgeKey>& curved_edges() const { return curved_; }
  /// Place of the edge a-b among the curved ones, or kNone where it is straight.
  int find(VertexId a, VertexId b) const;
  /// The edge's node, which comes behind so many vertices, or kNone where it is straight.
  int node_of(VertexId a, VertexId b, int num_vertices) const {
    const int at = find(a, b);
    return at == kNone ? kNone : num_vertices + at;
  }

  bool operator==(const Space&) const = default;

 private:
  std::vector<EdgeKey> curved_;
};

/// The space whose cells have these orders (1 or 2) by body; bodies that are not named are linear. An edge has the least
/// order of its cells.
template <int Dim>
Space space_of_orders(const Mesh<Dim>& mesh, const std::map<int, int>& order);

template <int Dim>
int num_nodes(const Mesh<Dim>& mesh, const Space& space) {
  return mesh.vertex_slots() + space.num_curved();
}

/// Whether an edge of the cell is curved.
template <int Dim>
bool has_curved_edge(const Mesh<Dim>& mesh, const Space& space, CellId c);

/// Whether each edge of each cell of a mesh with cells is curved.
template <int Dim>
bool is_all_curved(const Mesh<Dim>& mesh, const Space& space);

/// Rest positions of all nodes [m].
template <int Dim>
std::vector<Vec<Dim>> node_rest_positions(const Mesh<Dim>& mesh, const Space& space);

/// The boundary facet's part of the surface that can touch: simplices through all of its nodes (their ids), oriented as the
/// facet. A triangle with 1, 2, 3 curved edges gives 2, 3, 4; with 2 the diagonal starts at the vertex of lower id.
template <int Dim>
void add_chord_facets(const typename MeshTypes<Dim>::Facet& facet, const Space& space, int num_vertices,
                      std::vector<typename MeshTypes<Dim>::Facet>& chords);

}  // namespace itr
