// SPDX-License-Identifier: MIT
#include "itr/simulation/problem_cache.hpp"

#include <algorithm>

#include "itr/simulation/step_problem.hpp"

namespace itr {

template <int Dim>
MeshScope<Dim>::MeshScope(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh)
    : cells(whole_mesh(mesh, setup.obstacles.rest)), diagonal(rest_diagonal(mesh)) {
  if (setup.contact.enabled) surface = contact_surface(setup, mesh);
}

template <int Dim>
bool MeshScope<Dim>::is_of(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh) const {
  const auto& obstacles = setup.obstacles.rest;
  const int bodies = mesh.vertex_slots();
  if (cells.num_vertices != bodies + static_cast<int>(obstacles.size()) ||
      static_cast<int>(cells.elements.size()) != mesh.cell_slots() ||
      static_cast<int>(cells.facets.size()) != mesh.facet_slots())
    return false;
  for (VertexId v = 0; v < bodies; ++v)
    if (cells.rest[v] != mesh.rest(v)) return false;
  if (!std::equal(obstacles.begin(), obstacles.end(), cells.rest.begin() + bodies)) return false;
  for (CellId c = 0; c < mesh.cell_slots(); ++c)
    if (cells.elements[c].vertices != mesh.cell(c) || cells.elements[c].body != mesh.body(c)) return false;
  for (FacetId f = 0; f < mesh.facet_slots(); ++f)
    if (cells.facets[f].vertices != mesh.facet(f) || cells.facets[f].tag != mesh.facet_tag(f)) return false;
  return true;
}

template <int Dim>
std::shared_ptr<MeshScope<Dim>> ProblemCache<Dim>::scope_of(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh) {
  if (!scope || !scope->is_of(setup, mesh)) scope = std::make_shared<MeshScope<Dim>>(setup, mesh);
  return scope;
}

template struct MeshScope<2>;
template struct MeshScope<3>;
template struct ProblemCache<2>;
template struct ProblemCache<3>;

}  // namespace itr
