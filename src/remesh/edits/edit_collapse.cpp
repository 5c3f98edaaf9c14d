// SPDX-License-Identifier: MIT
#include <bit>

#include "edit_checks.hpp"
#include "old_fields.hpp"

namespace itr {

namespace {

template <typename List>
bool contains(const List& list, int item) {
  return std::find(list.begin(), list.end(), item) != list.end();
}

/// Vertices around one end of an edge with whether they are in the edge's link: a hash table with linear probing.
class Neighbourhood {
 public:
  explicit Neighbourhood(std::size_t most) : slots_(std::bit_ceil(2 * most + 1)) {}
  void add(VertexId v) { slots_[find(v)].vertex = v; }
  void put_in_link(VertexId v) { slots_[find(v)] = {v, true}; }
  bool holds(VertexId v) const { return slots_[find(v)].vertex == v; }
  bool is_in_link(VertexId v) const { return slots_[find(v)].in_link; }

 private:
  struct Slot {
    VertexId vertex = kNone;
    bool in_link = false;
  };
  std::size_t find(VertexId v) const {
    const std::size_t mask = slots_.size() - 1;
    std::size_t i = static_cast<std::size_t>(v) * 0x9e3779b97f4a7c15ull >> 32 & mask;
    while (slots_[i].vertex != kNone && slots_[i].vertex != v) i = (i + 1) & mask;
    return i;
  }
  std::vector<Slot> slots_;
};

/// Link condition in the volume: whatever vertices and edges the links of a and b have in common must be in the link of a-b.
template <int Dim>
bool keeps_cells_apart(const Mesh<Dim>& mesh, VertexId a, VertexId b, std::span<const CellId> around_edge) {
  const auto around_a = mesh.cells_of(a);
  Neighbourhood beside_a(Dim * around_a.size());
  for (const CellId c : around_a)
    for (const int v : mesh.cell(c))
      if (v != a) beside_a.add(v);
  for (const CellId c : around_edge)
    for (const int v : mesh.cell(c))
      if (v != a && v != b) beside_a.put_in_link(v);
  std::vector<EdgeKey> pairs;  // vertices of the link that b, but not a with b, has a cell on
  for (const CellId c : mesh.cells_of(b)) {
    const auto& cell = mesh.cell(c);
    if (holds(cell, a)) continue;
    std::array<VertexId, Dim + 1> common;
    int n = 0;
    for (const int w : cell) {
      if (w == b || !beside_a.holds(w)) continue;
      if (!beside_a.is_in_link(w)) return false;
      common[n++] = w;
    }
    for (int i = 0; i < n; ++i)
      for (int j = i + 1; j < n; ++j) pairs.push_back({common[i], common[j]});
  }
  const auto hold = [&](const auto& cells, const EdgeKey& pair) {
    return std::any_of(cells.begin(), cells.end(),
                       [&](CellId c) { return holds(mesh.cell(c), pair[0]) && holds(mesh.cell(c), pair[1]); });
  };
  return std::none_of(pairs.begin(), pairs.end(),
                      [&](const EdgeKey& pair) { return !hold(around_edge, pair) && hold(around_a, pair); });
}

/// Link conditions among the facets of the boundary and of interfaces and, for a feature's edge, among features.
template <int Dim>
bool keeps_sheets_apart(const Mesh<Dim>& mesh, const Strata<Dim>& strata, const EdgeKey& edge, Stratum along) {
  const auto vertices_of = [](const auto& sheets) {
    std::vector<VertexId> vertices;
    for (const auto& sheet : sheets) vertices.insert(vertices.end(), sheet.vertices.begin(), sheet.vertices.end());
    return vertices;
  };
  const auto beside_a = vertices_of(strata.sheets_of(mesh, edge[0])), link = vertices_of(strata.sheets_of_edge(mesh, edge));
  for (const int w : vertices_of(strata.sheets_of(mesh, edge[1])))
    if (!contains(link, w) && contains(beside_a, w)) return false;
  if (along != Stratum::feature) return true;
  const auto features = strata.feature_neighbours(mesh, edge[0]);
  for (const VertexId w : strata.feature_neighbours(mesh, edge[1]))
    if (contains(features, w)) return false;
  return true;
}

/// One way to collapse an edge: `gone` merges into `kept`, which may move.
template <int Dim>
struct Merge {
  VertexId gone, kept;
  Vec<Dim> place;
  bool moves;
};

template <int Dim>
bool keeps_shape(const Mesh<Dim>& mesh, const Merge<Dim>& merge, const QualityRule& rule) {
  const auto around = mesh.cells_of(merge.gone);
  double worst = worst_quality<Dim>(mesh, around);
  if (merge.moves) worst = std::min(worst, worst_quality<Dim>(mesh, mesh.cells_of(merge.kept)));
  const double least = rule.least(worst);
  const auto fine = [&](CellId c, VertexId end, VertexId other) {
    if (holds(mesh.cell(c), other)) return true;
    const double quality = quality_with<Dim>(mesh, mesh.cell(c), end, merge.place);
    return quality > 0 && quality >= least;
  };
  if (!std::all_of(around.begin(), around.end(), [&](CellId c) { return fine(c, merge.gone, merge.kept); })) return false;
  const auto ring = mesh.cells_of(merge.kept);
  return !merge.moves || std::all_of(ring.begin(), ring.end(), [&](CellId c) { return fine(c, merge.kept, merge.gone); });
}

/// An edge to the vertex that stays is curved if an edge that it replaces was; on the boundary, if one of the boundary was.
/// An edge that is there before and after, with its vertices where they were, keeps what it has.
template <int Dim>
void merge_nodes(const Mesh<Dim>& mesh, const Merge<Dim>& merge, Edit<Dim>& edit) {
  const auto& [gone, kept, place, moves] = merge;
  std::vector<VertexId> around;  // in a fixed order
  for (const CellId c : edit.removed_cells)
    for (const VertexId v : mesh.cell(c))
      if (v != gone && v != kept) around.push_back(v);
  std::sort(around.begin(), around.end());
  around.erase(std::unique(around.begin(), around.end()), around.end());
  const auto on_boundary = [&](VertexId v) {
    return std::any_of(edit.inserted_facets.begin(), edit.inserted_facets.end(),
                       [&](const auto& facet) { return holds(facet.vertices, kept) && holds(facet.vertices, v); });
  };
  const auto remove = [&](VertexId end, VertexId v) {  // returns whether the edge's node has a successor
    if (mesh.node_of(end, v) == kNone) return false;
    const EdgeKey edge = edge_key(end, v);
    edit.removed_nodes.push_back(edge);
    return v != kept && (!on_boundary(v) || !mesh.facets_of_edge(edge).empty());
  };
  remove(gone, kept);
  for (const VertexId v : around) {
    bool is_curved = remove(gone, v);
    if (moves)
      is_curved = remove(kept, v) || is_curved;
    else if (mesh.are_joined(kept, v))
      continue;
    if (is_curved) insert_node(mesh, kept, v, edit);
  }
}

template <int Dim>
Edit<Dim> make_edit(const Mesh<Dim>& mesh, const EdgeKey& edge, const Merge<Dim>& merge) {
  const auto& [gone, kept, place, moves] = merge;
  Edit<Dim> edit{.kind = Edit<Dim>::Kind::collapse, .edge = edge};
  typename Edit<Dim>::Value value{kept, place};
  value.parents[0] = kept;
  value.parents[1] = gone;
  value.num_parents = moves ? 2 : 1;
  value.weights[0] = moves ? 0.5 : 1;
  value.weights[1] = moves ? 0.5 : 0;
  if (const VertexId node = mesh.node_of(kept, gone); moves && node != kNone) {
    value.parents[0] = node;
    value.weights[0] = value.num_parents = 1;
  }
  edit.value = value;
  edit.removed_vertex = gone;

  const auto around = mesh.cells_of(gone);
  edit.removed_cells.assign(around.begin(), around.end());
  if (moves)
    for (const CellId c : mesh.cells_of(kept))
      if (!holds(mesh.cell(c), gone)) edit.removed_cells.push_back(c);
  std::sort(edit.removed_cells.begin(), edit.removed_cells.end());
  for (const CellId c : edit.removed_cells) {
    const auto& cell = mesh.cell(c);
    if (!(holds(cell, gone) && holds(cell, kept))) edit.inserted_cells.push_back({replaced(cell, gone, kept), mesh.body(c)});
  }
  const auto replace_facet = [&](FacetId f) {
    edit.removed_facets.push_back(f);
    const auto& facet = mesh.facet(f);
    if (!(holds(facet, gone) && holds(facet, kept)))
      edit.inserted_facets.push_back({replaced(facet, gone, kept), mesh.facet_tag(f), f});
  };
  for (const FacetId f : mesh.facets_of(gone)) replace_facet(f);
  if (moves)
    for (const FacetId f : mesh.facets_of(kept))
      if (!holds(mesh.facet(f), gone)) replace_facet(f);
  for (const auto& facet : interfaces_among<Dim>(mesh, edit.removed_cells)) {
    if (!holds(facet, gone)) continue;
    edit.removed_interfaces.push_back(facet);
    if (!holds(facet, kept)) edit.inserted_interfaces.push_back({ascending(replaced(facet, gone, kept)), facet});
  }
  if (mesh.has_nodes()) merge_nodes(mesh, merge, edit);
  return edit;
}

}  // namespace

template <int Dim>
Proposal<Dim> propose_collapse(const Mesh<Dim>& mesh, const Strata<Dim>& strata, const EdgeKey& edge,
                               const QualityRule& rule) {
  const auto [a, b] = edge;
  const auto around_edge = mesh.cells_of_edge(edge);
  if (around_edge.empty()) return refused<Dim>(Refusal::gone);
  const Stratum at_a = strata.vertex(a), at_b = strata.vertex(b), along = strata.edge(mesh, edge);
  if (at_a == Stratum::non_manifold || at_b == Stratum::non_manifold || along == Stratum::non_manifold)
    return refused<Dim>(Refusal::non_manifold);
  if (at_a != along && at_b != along) return refused<Dim>(Refusal::held);
  if (!keeps_cells_apart(mesh, a, b, around_edge)) return refused<Dim>(Refusal::link);
  if (along != Stratum::volume && !keeps_sheets_apart(mesh, strata, edge, along)) return refused<Dim>(Refusal::link);
  std::vector<Merge<Dim>> merges;
  if (at_a == along && at_b == along) merges.push_back({b, a, 0.5 * (mesh.rest(a) + mesh.rest(b)), true});
  if (at_b == along) merges.push_back({b, a, mesh.rest(a), false});
  if (at_a == along) merges.push_back({a, b, mesh.rest(b), false});
  for (const Merge<Dim>& merge : merges) {
    if (!keeps_shape(mesh, merge, rule)) continue;
    Edit<Dim> edit = make_edit(mesh, edge, merge);
    if (extends_tags(mesh, edit)) return refused<Dim>(Refusal::held);
    return {.edit = std::move(edit)};
  }
  return refused<Dim>(Refusal::shape);
}

template Proposal<2> propose_collapse<2>(const Mesh<2>&, const Strata<2>&, const EdgeKey&, const QualityRule&);
template Proposal<3> propose_collapse<3>(const Mesh<3>&, const Strata<3>&, const EdgeKey&, const QualityRule&);

}  // namespace itr
