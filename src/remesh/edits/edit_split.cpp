// SPDX-License-Identifier: MIT
#include "edit_checks.hpp"

namespace itr {

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
  return edit;
}

template <int Dim>
Proposal<Dim> propose_split(const Mesh<Dim>& mesh, const EdgeKey& edge, const QualityRule& rule) {
  const auto cells = mesh.cells_of_edge(edge);
  if (cells.empty()) return refused<Dim>(Refusal::gone);
  const double least = rule.least(worst_quality<Dim>(mesh, cells));
  const Vec<Dim> middle = 0.5 * (mesh.rest(edge[0]) + mesh.rest(edge[1]));
  for (const CellId c : cells)
    for (const int end : edge) {
      const double quality = quality_with<Dim>(mesh, mesh.cell(c), end, middle);
      if (!(quality > 0 && quality >= least)) return refused<Dim>(Refusal::shape);
    }
  return {.edit = make_split(mesh, edge)};
}

template Edit<2> make_split<2>(const Mesh<2>&, const EdgeKey&);
template Edit<3> make_split<3>(const Mesh<3>&, const EdgeKey&);
template Proposal<2> propose_split<2>(const Mesh<2>&, const EdgeKey&, const QualityRule&);
template Proposal<3> propose_split<3>(const Mesh<3>&, const EdgeKey&, const QualityRule&);

}  // namespace itr
