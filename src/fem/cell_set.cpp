// SPDX-License-Identifier: MIT
#include "itr/fem/cell_set.hpp"

namespace itr {

template <int Dim>
CellSet<Dim> whole_mesh(const Mesh<Dim>& mesh, const std::vector<Vec<Dim>>& extra) {
  CellSet<Dim> set;
  set.num_vertices = mesh.vertex_slots() + static_cast<int>(extra.size());
  for (int v = 0; v < mesh.vertex_slots(); ++v) set.rest.push_back(mesh.rest(v));
  set.rest.insert(set.rest.end(), extra.begin(), extra.end());
  for (int c = 0; c < mesh.cell_slots(); ++c)
    if (mesh.is_cell_alive(c))
      set.elements.push_back({mesh.cell(c), mesh.body(c), mesh.volume(c), mesh.inverse_rest_edges(c)});
  for (int f = 0; f < mesh.facet_slots(); ++f)
    if (mesh.is_facet_alive(f)) set.facets.push_back({mesh.facet(f), mesh.facet_tag(f)});
  return set;
}

template CellSet<2> whole_mesh(const Mesh<2>&, const std::vector<Vec<2>>&);
template CellSet<3> whole_mesh(const Mesh<3>&, const std::vector<Vec<3>>&);

}  // namespace itr
