// SPDX-License-Identifier: MIT
#include <boost/container/small_vector.hpp>
#include "edit_checks.hpp"
#include "fem/quadratic.hpp"

namespace itr {

namespace {

/// The node of the edge from the midpoint of the edge ab to a vertex `c` of a cell there, if the old functions are quadratic
/// along it; of the half of the edge at `c` where c is a or b. What it has is the functions' value at the edge's middle.
template <int Dim>
void add_node_from_middle(const Mesh<Dim>& mesh, VertexId a, VertexId b, VertexId c, Edit<Dim>& edit) {
  typename Edit<Dim>::NewNode node{edge_key(c, kNewVertex)};
  const auto add = [&](const auto& ids, const auto& shapes) {
    for (int k = 0; k < shapes.size(); ++k)
      if (shapes[k] != 0) node.add_parent(ids[k], shapes[k]);
  };
  if (c == a || c == b) {
    const VertexId middle = mesh.node_of(a, b), other = c == a ? b : a;
    if (middle == kNone) return;
    add(std::array{c, other, middle}, quadratic_shapes<1>(1, {0.75, 0.25}));
  } else {
    const std::array ids{a, b, c, mesh.node_of(a, b), mesh.node_of(a, c), mesh.node_of(b, c)};
    CurvedEdges curved = 0;
    for (int edge = 0; edge < 3; ++edge)
      if (ids[3 + edge] != kNone) curved = static_cast<CurvedEdges>(curved | 1 << edge);
    if (curved == 0) return;
    add(ids, quadratic_shapes<2>(curved, {0.25, 0.25, 0.5}));
  }
  edit.inserted_nodes.push_back(node);
}

template <int Dim>
void add_nodes_of_split(const Mesh<Dim>& mesh, Edit<Dim>& edit) {
  const auto [a, b] = edit.edge;
  if (const VertexId middle = mesh.node_of(a, b); middle != kNone) {
    edit.removed_nodes.push_back(edit.edge);
    edit.value->parents[0] = middle;
    edit.value->weights[0] = 1;
    edit.value->num_parents = 1;
  }
  std::vector<VertexId> around{a, b};  // vertices of the cells, in a fixed order
  for (const CellId c : edit.removed_cells)
    for (const VertexId v : mesh.cell(c))
      if (std::find(around.begin(), around.end(), v) == around.end()) around.push_back(v);
  for (const VertexId v : around) add_node_from_middle(mesh, a, b, v, edit);
}

template <int Dim>
Edit<Dim> replace_by_themselves(const Mesh<Dim>& mesh, const EdgeKey& edge, typename Edit<Dim>::Kind kind) {
  Edit<Dim> edit{.kind = kind, .edge = edge};
  edit.removed_cells = mesh.cells_of_edge(edge);
  for (const CellId c : edit.removed_cells) edit.inserted_cells.push_back({mesh.cell(c), mesh.body(c)});
  edit.removed_facets = mesh.facets_of_edge(edge);
  for (const FacetId f : edit.removed_facets) edit.inserted_facets.push_back({mesh.facet(f), mesh.facet_tag(f), f});
  return edit;
}

}  // namespace

template <int Dim>
Edit<Dim> make_split(const Mesh<Dim>& mesh, const EdgeKey& edge) {
  const auto [a, b] = edge;
  Edit<Dim> edit{.kind = Edit<Dim>::Kind::split, .edge = edge};
  edit.removed_cells = mesh.cells_of_edge(edge);
  edit.inserted_cells.reserve(2 * edit.removed_cells.size());
  for (const CellId c : edit.removed_cells)
    for (const int end : {a, b}) edit.inserted_cells.push_back({replaced(mesh.cell(c), end, kNewVertex), mesh.body(c)});
  for (const FacetId f : mesh.facets_of(a)) {
    if (!holds(mesh.facet(f), b)) continue;
    edit.removed_facets.push_back(f);
    for (const int end : {a, b})
      edit.inserted_facets.push_back({replaced(mesh.facet(f), end, kNewVertex), mesh.facet_tag(f), f});
  }
  edit.removed_interfaces = interfaces_among<Dim>(mesh, edit.removed_cells);
  std::erase_if(edit.removed_interfaces, [&](const auto& facet) { return !holds(facet, a) || !holds(facet, b); });
  for (const auto& facet : edit.removed_interfaces)
    for (const int end : {a, b}) edit.inserted_interfaces.push_back({ascending(replaced(facet, end, kNewVertex)), facet});
  typename Edit<Dim>::Value value{kNewVertex, 0.5 * (mesh.rest(a) + mesh.rest(b))};
  value.num_parents = 2;
  value.parents[0] = a;
  value.parents[1] = b;
  value.weights[0] = value.weights[1] = 0.5;
  if (!edit.removed_facets.empty() && has_tag(mesh, edge)) value.tag = mesh.vertex_tag(a);
  edit.value = value;
  if (mesh.has_nodes()) add_nodes_of_split(mesh, edit);
  return edit;
}

template <int Dim>
int nodes_of_split(const Mesh<Dim>& mesh, const EdgeKey& edge) {
  if (!mesh.has_nodes()) return 1;
  const auto [a, b] = edge;
  const bool is_curved = mesh.node_of(a, b) != kNone;
  boost::container::small_vector<VertexId, 32> around;
  for (const CellId c : mesh.cells_of(a)) {
    const auto& cell = mesh.cell(c);
    if (!holds(cell, b)) continue;
    for (const VertexId v : cell)
      if (v != a && v != b && std::find(around.begin(), around.end(), v) == around.end()) around.push_back(v);
  }
  const auto gets_node = [&](VertexId v) {  // see add_node_from_middle
    return is_curved || mesh.node_of(a, v) != kNone || mesh.node_of(b, v) != kNone;
  };
  return 1 + (is_curved ? 1 : 0) + static_cast<int>(std::count_if(around.begin(), around.end(), gets_node));
}

template <int Dim>
Edit<Dim> make_curve(const Mesh<Dim>& mesh, const EdgeKey& edge) {
  Edit<Dim> edit = replace_by_themselves(mesh, edge, Edit<Dim>::Kind::curve);
  typename Edit<Dim>::NewNode node{edge};
  for (const VertexId end : edge) node.add_parent(end, 0.5);
  edit.inserted_nodes.push_back(node);
  return edit;
}

template <int Dim>
Edit<Dim> make_straighten(const Mesh<Dim>& mesh, const EdgeKey& edge) {
  Edit<Dim> edit = replace_by_themselves(mesh, edge, Edit<Dim>::Kind::straighten);
  edit.removed_nodes.push_back(edge);
  return edit;
}

template <int Dim>
Edit<Dim> make_chords(const Mesh<Dim>& mesh, const EdgeKey& edge) {
  Edit<Dim> edit = make_split(mesh, edge);
  edit.kind = Edit<Dim>::Kind::chords;
  std::erase_if(edit.inserted_nodes, [&](const auto& node) {
    return node.edge == edge_key(edge[0], kNewVertex) || node.edge == edge_key(edge[1], kNewVertex);
  });
  return edit;
}

#define ITR_INSTANTIATE(Dim)                                                 \
  template Edit<Dim> make_split<Dim>(const Mesh<Dim>&, const EdgeKey&);      \
  template int nodes_of_split<Dim>(const Mesh<Dim>&, const EdgeKey&);        \
  template Edit<Dim> make_curve<Dim>(const Mesh<Dim>&, const EdgeKey&);      \
  template Edit<Dim> make_straighten<Dim>(const Mesh<Dim>&, const EdgeKey&); \
  template Edit<Dim> make_chords<Dim>(const Mesh<Dim>&, const EdgeKey&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
