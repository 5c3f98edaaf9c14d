// SPDX-License-Identifier: MIT
#include "change_log.hpp"

#include <numeric>

#include "remesh/curved_cell.hpp"

namespace itr {

template <int Dim>
void ChangeLog<Dim>::write(VertexId v) {
  touched_[v].written = now();
  for (const CellId c : mesh_.cells_of(v))
    for (const VertexId w : mesh_.cell(c)) {
      touched_[w].last_around = now();
      if (touched_[w].first_around == 0) touched_[w].first_around = now();
    }
}

template <int Dim>
void ChangeLog<Dim>::write_surface(VertexId v) {
  const auto include = [&](VertexId w) { surfaces_.back().include(x_.template segment<Dim>(Dim * w)); };
  for_each_facet_at(mesh_, v, [&](FacetId f) {
    for (const VertexId w : mesh_.facet(f)) include(w);
    for_each_node_on<Dim>(mesh_.facet(f), nodes_of_edges(mesh_), include);
  });
}

template <int Dim>
Change<Dim> ChangeLog<Dim>::commit(const Edit<Dim>& edit, std::span<const Position> positions) {
  surfaces_.emplace_back();
  const VertexId first_slot = mesh_.node_slots();
  for (const CellId c : edit.removed_cells)
    for (const VertexId v : mesh_.cell(c)) write(v);
  if (logs_surface_) {
    for (const FacetId f : edit.removed_facets) write_surface(mesh_.facet(f)[0]);
    for (const auto& [v, x] : positions)
      if (v < first_slot) write_surface(v);
  }

  for (const auto& prepare : forerunners_) prepare(edit);
  const CellId first_cell = mesh_.cell_slots();
  const FacetId first_facet = mesh_.facet_slots();
  Change<Dim> change{.edit = edit, .created = mesh_.apply(edit), .first_facet = first_facet, .first_node = kNone};
  change.first_node = mesh_.node_slots() - static_cast<int>(edit.inserted_nodes.size());
  change.cells.resize(mesh_.cell_slots() - first_cell);
  std::iota(change.cells.begin(), change.cells.end(), first_cell);
  const auto slot_of = [&](VertexId v) {
    return v < first_slot ? v : v == kNewVertex ? change.created : change.first_node + (kNewVertex - 1 - v);
  };
  for (const auto& [v, x] : positions) change.positions.push_back({slot_of(v), x});
  touched_.resize(mesh_.node_slots());
  for (const auto& follow : followers_) follow(change);

  for (const auto& [v, x] : change.positions) {
    write(v);
    if (const EdgeKey ends = mesh_.edge_of_node(v); ends[0] != kNone)
      for (const VertexId end : ends) write(end);
  }
  for (const CellId c : change.cells)
    for (const VertexId v : mesh_.cell(c)) write(v);
  if (logs_surface_) {
    for (const auto& [v, x] : change.positions) write_surface(v);
    for (FacetId f = first_facet; f < mesh_.facet_slots(); ++f) write_surface(mesh_.facet(f)[0]);
  }
  return change;
}

template class ChangeLog<2>;
template class ChangeLog<3>;

}  // namespace itr
