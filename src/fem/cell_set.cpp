// SPDX-License-Identifier: MIT
#include "fem/cell_set.hpp"

namespace itr {

template <int Dim>
CellSet<Dim> whole_mesh(const Mesh<Dim>& mesh, const std::vector<Vec<Dim>>& extra) {
  CellSet<Dim> set;
  set.axisymmetric = mesh.is_axisymmetric();
  set.rest = mesh.rest();
  set.rest.insert(set.rest.end(), extra.begin(), extra.end());
  set.num_vertices = static_cast<int>(set.rest.size());
  std::vector<typename CellSet<Dim>::Element> curved;
  for (const CellId c : mesh.live_cells()) {
    const auto element = element_of(mesh, c);
    (element.curved && !set.axisymmetric ? curved : set.elements).push_back(element);
  }
  set.elements.insert(set.elements.end(), curved.begin(), curved.end());
  for (const FacetId f : mesh.live_facets()) {
    auto& facet = set.facets.emplace_back();
    facet = {mesh.facet(f), mesh.facet_tag(f), mesh.part_of_vertex(mesh.facet(f)[0])};
    facet.curved = find_edge_nodes<Dim - 1>(mesh.facet(f), nodes_of_edges(mesh), facet.edge_nodes);
  }
  return set;
}

template CellSet<2> whole_mesh(const Mesh<2>&, const std::vector<Vec<2>>&);
template CellSet<3> whole_mesh(const Mesh<3>&, const std::vector<Vec<3>>&);

}  // namespace itr
