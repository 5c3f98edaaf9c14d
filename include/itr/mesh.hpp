// SPDX-License-Identifier: MIT
// The simplicial mesh of the bodies' rest shape: triangles in 2D, tetrahedra in 3D.
//
// Cells, boundary facets and vertices live in slots; an edit kills some and adds some, ids of the others stay. compact()
// removes dead slots. Boundary facets are the facets with one incident cell; they, and single vertices, carry the tags that
// boundary conditions refer to.
//
// Cells are straight at rest. An edge may be curved: it carries one node more, at its middle at rest; on a straight edge
// fields are linear. All edges curved is P2, none is P1, and every mixture is conforming, since cells that share an edge
// agree about it. Fields are indexed by node: a vertex, or a curved edge's node, which has a slot among the vertices but is
// not alive there and has no cells. In a compact mesh the nodes of curved edges come behind the vertices, in the order of
// their edges.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <optional>
#include <ranges>
#include <span>
#include <utility>
#include <vector>

#include "itr/types.hpp"

namespace itr {

/// A rest position [m] and the body that it is a point of. Points of the two faces of a crack, or of bodies that touch, have
/// one position; `inward` and `part` tell them apart.
template <int Dim>
struct RestPoint : Vec<Dim> {
  Vec<Dim> inward = Vec<Dim>::Zero();  ///< a direction from the point into its body; 0: unknown
  int part = kNone;                    ///< its connected part, Mesh::part; kNone: unknown

  template <typename Derived>
  RestPoint(const Eigen::MatrixBase<Derived>& X) : Vec<Dim>(X) {}
  RestPoint(double x, double y) requires(Dim == 2) : Vec<Dim>(x, y) {}
  RestPoint(double x, double y, double z) requires(Dim == 3) : Vec<Dim>(x, y, z) {}
  RestPoint(const Vec<Dim>& X, const Vec<Dim>& direction, int connected_part)
      : Vec<Dim>(X), inward(direction), part(connected_part) {}
};

/// Tag of a boundary facet or vertex that no selection named: carries no boundary condition.
inline constexpr int kNoTag = std::numeric_limits<int>::max();

/// Mesh::steps_apart of a vertex that coincides with nothing at rest, or has been apart from that for so many steps.
inline constexpr std::uint8_t kApart = 255;

/// Stands in an Edit for the vertex that the edit creates.
inline constexpr VertexId kNewVertex = std::numeric_limits<int>::max();
/// Stands for the i-th of the nodes that an edit creates.
constexpr VertexId new_node(int i) { return kNewVertex - 1 - i; }

constexpr EdgeKey edge_key(VertexId a, VertexId b) { return a < b ? EdgeKey{a, b} : EdgeKey{b, a}; }

struct EdgeKeyHash {
  std::size_t operator()(const EdgeKey& e) const {
    return static_cast<std::size_t>(e[0]) * 0x9E3779B97F4A7C15ull ^ (static_cast<std::size_t>(e[1]) * 0xC2B2AE3D27D4EB4Full);
  }
};

template <int Dim>
struct MeshTypes {
  using Cell = std::array<VertexId, Dim + 1>;  ///< vertices, positive volume in the rest shape
  using Facet = std::array<VertexId, Dim>;     ///< vertices, outward oriented (2D: the body lies left of a -> b)
};

/// One change of a mesh as a value: made from a const mesh, previewed, then committed with Mesh::apply or dropped.
template <int Dim>
struct Edit {
  using Cell = typename MeshTypes<Dim>::Cell;
  using Facet = typename MeshTypes<Dim>::Facet;
  enum class Kind { split, collapse, swap, smooth, curve, straighten, chords };

  struct NewCell {
    Cell vertices;
    int body;
  };
  struct NewFacet {
    Facet vertices;
    int tag;
    FacetId parent = kNone;  ///< the removed facet whose place it takes a part of, or one of them
  };
  /// A facet between two bodies, vertices ascending (kNewVertex is the largest id).
  struct NewInterface {
    Facet vertices;
    Facet parent;  ///< the removed one whose place it takes a part of, or one of them
  };
  static constexpr int kMostParents = (Dim + 1) * (Dim + 2) / 2;  ///< the nodes of a cell
  /// The one vertex whose position and field values the edit sets: kNewVertex, or one that stays.
  struct Value {
    VertexId vertex;
    Vec<Dim> rest;                                 ///< new rest position [m]
    std::array<VertexId, kMostParents> parents{};  ///< its fields are the weighted sums over parents of the old mesh
    std::array<double, kMostParents> weights{};
    int num_parents = 0;
    int tag = kNoTag;  ///< of a new vertex
  };
  /// The node of an edge that the edit curves, or that lies elsewhere after it, with fields as those of a Value.
  struct NewNode {
    EdgeKey edge;  ///< smaller id first
    std::array<VertexId, kMostParents> parents{};
    std::array<double, kMostParents> weights{};
    int num_parents = 0;
    void add_parent(VertexId v, double weight) {
      parents[num_parents] = v;
      weights[num_parents++] = weight;
    }
  };

  Kind kind;
  EdgeKey edge{kNone, kNone};  ///< the edge; of a 2-3 swap the one it makes; of a smooth none
  std::vector<CellId> removed_cells{};
  std::vector<NewCell> inserted_cells{};
  std::vector<FacetId> removed_facets{};
  std::vector<NewFacet> inserted_facets{};
  std::vector<Facet> removed_interfaces{};
  std::vector<NewInterface> inserted_interfaces{};
  std::optional<Value> value{};
  VertexId removed_vertex = kNone;
  std::vector<NewNode> inserted_nodes{};
  std::vector<EdgeKey> removed_nodes{};  ///< edges that are gone, straight or elsewhere after the edit

  /// Whether the space after the edit contains the one before, so that every field stays the function that it was.
  bool is_nested() const { return kind == Kind::split || kind == Kind::curve; }
  /// The id of the node that this edge has after the edit if the edit creates it, or kNone.
  VertexId inserted_node(const EdgeKey& e) const {
    for (std::size_t i = 0; i < inserted_nodes.size(); ++i)
      if (inserted_nodes[i].edge == e) return new_node(static_cast<int>(i));
    return kNone;
  }
  /// The node that the edit creates with this id, or null.
  const NewNode* created_node(VertexId id) const {
    const int i = new_node(id);  // its own inverse
    return i >= 0 && i < static_cast<int>(inserted_nodes.size()) ? &inserted_nodes[i] : nullptr;
  }
  /// By how many nodes, vertices among them, the edit enlarges the space; below 0: makes it smaller.
  int added_nodes() const {
    return static_cast<int>(inserted_nodes.size()) - static_cast<int>(removed_nodes.size()) + sets(kNewVertex) -
           (removed_vertex != kNone);
  }
  /// Whether the edit sets this vertex.
  bool sets(VertexId v) const { return value && value->vertex == v; }
};

/// The facet of a positively oriented cell opposite its vertex `k`, oriented outward.
template <int Dim>
ITR_EXPORT typename MeshTypes<Dim>::Facet opposite_facet(const typename MeshTypes<Dim>::Cell& cell, int k);

/// The ids in ascending order: what names a facet or a cell whatever its orientation.
template <std::size_t N>
std::array<int, N> ascending(std::array<int, N> ids) {
  std::sort(ids.begin(), ids.end());
  return ids;
}

/// New ids of a compact mesh by old id, kNone for an entity that is gone. Entries beyond those of the old mesh belong to
/// entities that were made meanwhile.
struct MeshRenumbering {
  std::vector<VertexId> vertex;  ///< of vertices, and of nodes of curved edges
  std::vector<CellId> cell;
  std::vector<FacetId> facet;
  bool empty() const { return vertex.empty(); }
};

template <int Dim>
class ITR_EXPORT Mesh {
 public:
  using Cell = typename MeshTypes<Dim>::Cell;
  using Facet = typename MeshTypes<Dim>::Facet;

  Mesh() = default;

  /// Builds adjacency and boundary facets (all tagged kNoTag).
  /// Throws InputError (place "cell i") for an index out of range, a cell of zero or negative rest volume, or a facet with
  /// more than two cells. `body` has one body id a cell.
  Mesh(std::vector<Vec<Dim>> rest, std::vector<Cell> cells, std::vector<int> body);

  /// Gives the boundary facets these slots and tags: a mesh that is read back numbers them as the one that was saved did.
  /// Throws InputError where `facets` are not the boundary facets, each once.
  void set_facets(const std::vector<Facet>& facets, const std::vector<int>& tags);

  /// Names the content: meshes of one revision are equal, a copy has that of the original, a change gives a new one.
  std::uint64_t revision() const { return revision_; }
  /// Whether rest positions are (r, z) of bodies of revolution about r = 0 (docs/theory.md, "Axisymmetry"); 2D only.
  bool is_axisymmetric() const { return is_axisymmetric_; }
  void set_axisymmetric(bool is) requires(Dim == 2) {
    is_axisymmetric_ = is;
    renew_revision();
  }
  /// Whether the node lies on the axis of an axisymmetric mesh, where it has no radial displacement.
  bool is_on_axis(VertexId node) const {
    if (!is_axisymmetric_) return false;
    const EdgeKey edge = edge_of_node(node);
    return edge[0] == kNone ? rest_[node][0] == 0 : rest_[edge[0]][0] == 0 && rest_[edge[1]][0] == 0;
  }
  int num_vertices() const { return num_vertices_; }  ///< alive ones; ids run to node_slots(), of a compact mesh to this
  int num_curved() const { return num_curved_; }      ///< edges that are curved
  int num_nodes() const { return num_vertices_ + num_curved_; }
  int num_cells() const { return num_cells_; }
  int num_facets() const { return num_facets_; }
  int node_slots() const { return static_cast<int>(rest_.size()); }  ///< vertices and nodes of curved edges, dead or alive
  int cell_slots() const { return static_cast<int>(cells_.size()); }
  int facet_slots() const { return static_cast<int>(facets_.size()); }
  bool is_vertex_alive(VertexId v) const { return vertex_alive_[v]; }
  bool is_cell_alive(CellId c) const { return cells_[c][0] != kNone; }
  bool is_facet_alive(FacetId f) const { return facets_[f][0] != kNone; }
  /// Ranges of the slots in use, ascending.
  auto live_vertices() const {
    return std::views::iota(0, node_slots()) | std::views::filter([this](VertexId v) { return is_vertex_alive(v); });
  }
  auto live_cells() const {
    return std::views::iota(0, cell_slots()) | std::views::filter([this](CellId c) { return is_cell_alive(c); });
  }
  auto live_facets() const {
    return std::views::iota(0, facet_slots()) | std::views::filter([this](FacetId f) { return is_facet_alive(f); });
  }
  /// Whether there are no dead slots, and vertices come before the nodes of curved edges.
  bool is_compact() const;

  const std::vector<Vec<Dim>>& rest() const { return rest_; }  ///< rest positions by node [m]
  const Vec<Dim>& rest(VertexId v) const { return rest_[v]; }
  const Cell& cell(CellId c) const { return cells_[c]; }
  int body(CellId c) const { return body_[c]; }
  /// The number of the part of the mesh that shared vertices connect, as it was made. Edits keep it; numbers of two meshes
  /// compare only if edits made one of the other, and a mesh that is read from a file counts anew.
  int part(CellId c) const { return part_[c]; }
  int part_of_vertex(VertexId v) const { return cells_of_[v].empty() ? kNone : part_[cells_of_[v][0]]; }
  Vec<Dim> barycenter(CellId c) const;                    ///< of the rest shape [m]
  double volume(CellId c) const { return volume_[c]; }    ///< rest area (2D) or volume (3D)
  double quality(CellId c) const { return quality_[c]; }  ///< simplex_quality of the rest shape
  /// Inverse of the matrix whose columns are the rest edges X_1 - X_0, ..., X_Dim - X_0.
  const Mat<Dim>& inverse_rest_edges(CellId c) const { return inverse_edges_[c]; }
  const Facet& facet(FacetId f) const { return facets_[f]; }
  int facet_tag(FacetId f) const { return facet_tag_[f]; }
  void set_facet_tag(FacetId f, int tag) {
    facet_tag_[f] = tag;
    renew_revision();
  }
  /// Tag of a boundary vertex by itself, whatever its facets' tags are. Edits never move nor remove a vertex with a tag, and
  /// give the tag to a new one on a boundary edge between two that share it.
  int vertex_tag(VertexId v) const { return vertex_tag_[v]; }
  void set_vertex_tag(VertexId v, int tag) {
    vertex_tag_[v] = tag;
    renew_revision();
  }
  /// For how many steps the vertex has been apart from the faces that coincide with it at rest: 0 as long as these are
  /// closed (ClosedFaces). Edits give it the least of the parents of its values. Only scenes with contact set it.
  std::uint8_t steps_apart(VertexId v) const { return steps_apart_[v]; }
  void set_steps_apart(VertexId v, std::uint8_t steps) {
    if ((steps == 0) != (steps_apart_[v] == 0)) renew_revision();
    steps_apart_[v] = steps;
  }
  /// The tag of both ends of an edge of the surface, all of which conditions with that tag hold; else kNoTag.
  int edge_tag(const EdgeKey& edge) const {
    const int tag = vertex_tag_[edge[0]];
    return tag != kNoTag && tag == vertex_tag_[edge[1]] && !facets_of_edge(edge).empty() ? tag : kNoTag;
  }
  std::span<const CellId> cells_of(VertexId v) const { return cells_of_[v]; }
  std::span<const FacetId> facets_of(VertexId v) const { return facets_of_[v]; }
  bool is_boundary(VertexId v) const { return !facets_of_[v].empty(); }
  /// The vertex as a point of the body that it belongs to.
  RestPoint<Dim> point(VertexId v) const;
  /// The middle of an edge of alive cells, likewise.
  RestPoint<Dim> middle(const EdgeKey& edge) const;
  /// A vertex or the node of a curved edge, likewise.
  RestPoint<Dim> point_of_node(VertexId node) const {
    const EdgeKey edge = edge_of_node(node);
    return edge[0] == kNone ? point(node) : middle(edge);
  }

  /// Cells that hold both ends of the edge, ascending.
  std::vector<CellId> cells_of_edge(const EdgeKey& edge) const;
  /// Whether some cell holds both vertices.
  bool are_joined(VertexId a, VertexId b) const;
  /// Boundary facets that hold both ends of the edge.
  std::vector<FacetId> facets_of_edge(const EdgeKey& edge) const;
  /// Whether cells of more than one body meet at the vertex.
  bool is_on_interface(VertexId v) const;
  /// The boundary facet on these vertices in any order, or kNone.
  FacetId find_facet(const Facet& vertices) const;
  /// All edges of alive cells, ascending.
  std::vector<EdgeKey> edges() const;
  double total_volume() const;

  /// Whether any edge is curved.
  bool has_nodes() const { return num_curved_ > 0; }
  /// The node of the edge; kNone where it is straight.
  VertexId node_of(VertexId a, VertexId b) const {
    const auto lower = static_cast<std::size_t>(std::min(a, b));
    if (lower >= nodes_from_.size()) return kNone;
    const VertexId upper = std::max(a, b);
    for (const auto& [end, node] : nodes_from_[lower])
      if (end == upper) return node;
    return kNone;
  }
  VertexId node_of(const EdgeKey& edge) const { return node_of(edge[0], edge[1]); }
  /// The edge of which this is the node; {kNone, kNone} of a vertex.
  EdgeKey edge_of_node(VertexId node) const {
    const auto slot = static_cast<std::size_t>(node);
    return slot < edge_of_node_.size() ? edge_of_node_[slot] : EdgeKey{kNone, kNone};
  }
  /// Whether an edge of the cell is curved.
  bool is_curved(CellId c) const;
  /// The curved edges, ascending.
  std::vector<EdgeKey> curved_edges() const;
  /// Makes these edges of a compact mesh the curved ones (ascending, each once).
  void set_curved_edges(const std::vector<EdgeKey>& edges);
  /// Curves an edge: its node takes the next slot.
  VertexId add_node(const EdgeKey& edge);

  /// Carries out an edit. Returns the id of the vertex that was created, or kNone. Ids of new cells are the next slots, in
  /// the order of the edit; its nodes take the last slots of vertices. Fields are the caller's to extend (see Edit::Value).
  VertexId apply(const Edit<Dim>& edit);

  /// Removes dead slots, keeps the order of the others. Nodes of curved edges come last, in the order of their edges.
  MeshRenumbering compact();

  /// First broken invariant in words (adjacency, orientation, facets against cells), or an empty string.
  std::string find_defect() const;

 private:
  void add_cell(const Cell& cell, int body, int part);
  void add_facet(const Facet& facet, int tag);
  void remove_cell(CellId c);
  void remove_facet(FacetId f);
  std::array<Vec<Dim>, Dim + 1> corners(CellId c) const;
  void update_geometry(CellId c);
  void renew_revision();
  void remove_nodes();

  std::uint64_t revision_ = 0;  ///< of the mesh without anything
  int num_vertices_ = 0, num_cells_ = 0, num_facets_ = 0;
  bool is_axisymmetric_ = false;
  std::vector<Vec<Dim>> rest_;
  std::vector<char> vertex_alive_;
  std::vector<int> vertex_tag_;
  std::vector<std::uint8_t> steps_apart_;
  std::vector<Cell> cells_;
  std::vector<int> body_, part_;
  std::vector<double> volume_, quality_;
  std::vector<Mat<Dim>> inverse_edges_;
  std::vector<Facet> facets_;
  std::vector<int> facet_tag_;
  std::vector<std::vector<CellId>> cells_of_;
  std::vector<std::vector<FacetId>> facets_of_;
  int num_curved_ = 0;
  std::vector<std::vector<std::pair<VertexId, VertexId>>> nodes_from_;  ///< by lower end: upper end and node of each
  std::vector<EdgeKey> edge_of_node_;                                   ///< by slot, as far as there are nodes
};

/// The edges to curve where cells have these orders (1 or 2) by body, ascending; bodies that are not named are linear. An
/// edge has the least order of its cells.
template <int Dim>
ITR_EXPORT std::vector<EdgeKey> edges_of_order_2(const Mesh<Dim>& mesh, const std::map<int, int>& order);

/// Mesh::node_of of a mesh that stays, as a function.
template <int Dim>
auto nodes_of_edges(const Mesh<Dim>& mesh) {
  return [&mesh](VertexId a, VertexId b) { return mesh.node_of(a, b); };
}

extern template class Mesh<2>;
extern template class Mesh<3>;

}  // namespace itr
