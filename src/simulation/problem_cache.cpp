// SPDX-License-Identifier: MIT
#include "simulation/problem_cache.hpp"

#include <algorithm>

#include "simulation/closed_faces.hpp"
#include "simulation/step_problem.hpp"

namespace itr {

template <int Dim>
MeshScope<Dim>::MeshScope(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const Space& space, const ChordLevels& chords)
    : space(space), chords(chords), cells(whole_mesh(mesh, setup.obstacles.rest, space)), diagonal(rest_diagonal(mesh)) {
  if (setup.contact.enabled) surface = contact_surface(setup, mesh, space, chords);
}

template <int Dim>
bool MeshScope<Dim>::is_of(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const Space& asked,
                           const ChordLevels& asked_chords) const {
  const auto& obstacles = setup.obstacles.rest;
  const int bodies = num_nodes(mesh, space);
  if (space != asked || chords != asked_chords || cells.num_vertices != bodies + static_cast<int>(obstacles.size()) ||
      static_cast<int>(cells.elements.size() + cells.curved_elements.size()) != mesh.cell_slots() ||
      static_cast<int>(cells.facets.size() + cells.curved_facets.size()) != mesh.facet_slots())
    return false;
  for (VertexId v = 0; v < mesh.vertex_slots(); ++v)
    if (cells.rest[v] != mesh.rest(v) || surface.surface.closed.has_any(std::array{v}) != is_closed(mesh, space, v))
      return false;
  if (!std::equal(obstacles.begin(), obstacles.end(), cells.rest.begin() + bodies)) return false;
  if (!space.is_linear()) return has_cells_of(mesh);
  for (CellId c = 0; c < mesh.cell_slots(); ++c)
    if (cells.elements[c].vertices != mesh.cell(c) || cells.elements[c].body != mesh.body(c) ||
        cells.elements[c].part != mesh.part(c))
      return false;
  for (FacetId f = 0; f < mesh.facet_slots(); ++f)
    if (cells.facets[f].vertices != mesh.facet(f) || cells.facets[f].tag != mesh.facet_tag(f)) return false;
  return true;
}

/// Compares cells and facets in a space with curved edges: made anew, since both kinds of each share the mesh's order.
template <int Dim>
bool MeshScope<Dim>::has_cells_of(const Mesh<Dim>& mesh) const {
  const CellSet<Dim> other = whole_mesh(mesh, {}, space);
  const auto same = [](const auto& a, const auto& b, auto... members) {
    return std::ranges::equal(a, b, [&](const auto& p, const auto& q) { return ((p.*members == q.*members) && ...); });
  };
  using Cells = CellSet<Dim>;
  return same(cells.elements, other.elements, &Cells::Element::vertices, &Cells::Element::body, &Cells::Element::part) &&
         same(cells.curved_elements, other.curved_elements, &Cells::CurvedElement::nodes, &Cells::CurvedElement::body,
              &Cells::CurvedElement::part) &&
         same(cells.facets, other.facets, &Cells::BoundaryFacet::vertices, &Cells::BoundaryFacet::tag) &&
         same(cells.curved_facets, other.curved_facets, &Cells::CurvedFacet::nodes, &Cells::CurvedFacet::tag);
}

template <int Dim>
std::shared_ptr<MeshScope<Dim>> ProblemCache<Dim>::scope_of(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh,
                                                            const Space& space, const ChordLevels& chords) {
  if (!scope || !scope->is_of(setup, mesh, space, chords))
    scope = std::make_shared<MeshScope<Dim>>(setup, mesh, space, chords);
  return scope;
}

template struct MeshScope<2>;
template struct MeshScope<3>;
template struct ProblemCache<2>;
template struct ProblemCache<3>;

}  // namespace itr
