// SPDX-License-Identifier: MIT
#include "itr/fem/cell_set.hpp"

namespace itr {

template <int Dim>
CellSet<Dim> whole_mesh(const Mesh<Dim>& mesh, const std::vector<Vec<Dim>>& extra) {
  CellSet<Dim> set;
  const auto node_of = [&](VertexId a, VertexId b) { return mesh.node_of(a, b); };
  set.rest = mesh.rest();
  set.rest.insert(set.rest.end(), extra.begin(), extra.end());
  set.num_vertices = static_cast<int>(set.rest.size());
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    if (!mesh.is_cell_alive(c)) continue;
    typename CellSet<Dim>::CurvedElement element{{}, 0,           mesh.body(c), mesh.volume(c), mesh.inverse_rest_edges(c),
                                                 c,  mesh.part(c)};
    if (mesh.has_nodes()) element.curved = find_nodes<Dim>(mesh.cell(c), node_of, element.nodes);
    if (element.curved)
      set.curved_elements.push_back(element);
    else
      set.elements.push_back(element_of(mesh, c));
  }
  for (FacetId f = 0; f < mesh.facet_slots(); ++f) {
    if (!mesh.is_facet_alive(f)) continue;
    typename CellSet<Dim>::CurvedFacet facet{{}, 0, mesh.facet_tag(f), mesh.part_of_vertex(mesh.facet(f)[0])};
    if (mesh.has_nodes()) facet.curved = find_nodes<Dim - 1>(mesh.facet(f), node_of, facet.nodes);
    if (facet.curved)
      set.curved_facets.push_back(facet);
    else
      set.facets.push_back({mesh.facet(f), mesh.facet_tag(f), facet.part});
  }
  return set;
}

template CellSet<2> whole_mesh(const Mesh<2>&, const std::vector<Vec<2>>&);
template CellSet<3> whole_mesh(const Mesh<3>&, const std::vector<Vec<3>>&);

}  // namespace itr
