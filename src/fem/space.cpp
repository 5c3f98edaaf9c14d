// SPDX-License-Identifier: MIT
#include "itr/fem/space.hpp"

#include <algorithm>

#include "fem/chords.hpp"

namespace itr {

int Space::find(VertexId a, VertexId b) const {
  const EdgeKey edge = edge_key(a, b);
  const auto at = std::lower_bound(curved_.begin(), curved_.end(), edge);
  return at != curved_.end() && *at == edge ? static_cast<int>(at - curved_.begin()) : kNone;
}

template <int Dim>
Space space_of_orders(const Mesh<Dim>& mesh, const std::map<int, int>& order) {
  const auto is_quadratic = [&](CellId c) {
    const auto entry = order.find(mesh.body(c));
    return entry != order.end() && entry->second == 2;
  };
  if (std::none_of(order.begin(), order.end(), [](const auto& entry) { return entry.second == 2; })) return {};
  std::vector<EdgeKey> curved, straight;
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    if (!mesh.is_cell_alive(c)) continue;
    auto& edges = is_quadratic(c) ? curved : straight;
    const auto vertices = ascending(mesh.cell(c));
    for (int i = 0; i <= Dim; ++i)
      for (int j = i + 1; j <= Dim; ++j) edges.push_back({vertices[i], vertices[j]});
  }
  for (auto* edges : {&curved, &straight}) {
    std::sort(edges->begin(), edges->end());
    edges->erase(std::unique(edges->begin(), edges->end()), edges->end());
  }
  std::vector<EdgeKey> result;
  std::set_difference(curved.begin(), curved.end(), straight.begin(), straight.end(), std::back_inserter(result));
  return Space(std::move(result));
}

template <int Dim>
bool has_curved_edge(const Mesh<Dim>& mesh, const Space& space, CellId c) {
  if (space.is_linear()) return false;
  const auto& cell = mesh.cell(c);
  for (int i = 0; i <= Dim; ++i)
    for (int j = i + 1; j <= Dim; ++j)
      if (space.find(cell[i], cell[j]) != kNone) return true;
  return false;
}

template <int Dim>
bool is_all_curved(const Mesh<Dim>& mesh, const Space& space) {
  return !space.is_linear() && mesh.edges() == space.curved_edges();
}

template <int Dim>
std::vector<Vec<Dim>> node_rest_positions(const Mesh<Dim>& mesh, const Space& space) {
  std::vector<Vec<Dim>> rest;
  rest.reserve(num_nodes(mesh, space));
  for (VertexId v = 0; v < mesh.vertex_slots(); ++v) rest.push_back(mesh.rest(v));
  for (const auto& [a, b] : space.curved_edges()) rest.push_back((mesh.rest(a) + mesh.rest(b)) / 2);
  return rest;
}

template <int Dim>
void add_chord_facets(const typename MeshTypes<Dim>::Facet& facet, const Space& space, int num_vertices,
                      std::vector<typename MeshTypes<Dim>::Facet>& chords) {
  const auto node_of = [&](VertexId a, VertexId b) { return space.node_of(a, b, num_vertices); };
  for_each_chord<Dim>(facet, node_of, [&](const auto& ids) { chords.push_back(ids); });
}

template Space space_of_orders<2>(const Mesh<2>&, const std::map<int, int>&);
template Space space_of_orders<3>(const Mesh<3>&, const std::map<int, int>&);
template bool has_curved_edge<2>(const Mesh<2>&, const Space&, CellId);
template bool has_curved_edge<3>(const Mesh<3>&, const Space&, CellId);
template bool is_all_curved<2>(const Mesh<2>&, const Space&);
template bool is_all_curved<3>(const Mesh<3>&, const Space&);
template std::vector<Vec<2>> node_rest_positions<2>(const Mesh<2>&, const Space&);
template std::vector<Vec<3>> node_rest_positions<3>(const Mesh<3>&, const Space&);
template void add_chord_facets<2>(const MeshTypes<2>::Facet&, const Space&, int, std::vector<MeshTypes<2>::Facet>&);
template void add_chord_facets<3>(const MeshTypes<3>::Facet&, const Space&, int, std::vector<MeshTypes<3>::Facet>&);

}  // namespace itr
