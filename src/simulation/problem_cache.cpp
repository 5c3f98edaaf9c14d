// SPDX-License-Identifier: MIT
#include "simulation/problem_cache.hpp"

#include <algorithm>
#include <span>

#include "simulation/step_problem.hpp"

namespace itr {

template <int Dim>
MeshScope<Dim>::MeshScope(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ChordLevels& chords)
    : mesh_revision(mesh.revision()),
      chords(chords),
      cells(whole_mesh(mesh, setup.obstacles.rest)),
      diagonal(rest_diagonal(mesh)) {
  if (setup.contact.enabled) surface = contact_surface(setup, mesh, chords);
}

template <int Dim>
bool MeshScope<Dim>::is_of(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ChordLevels& asked_chords) const {
  return mesh_revision == mesh.revision() && chords == asked_chords &&
         std::ranges::equal(setup.obstacles.rest, std::span(cells.rest).subspan(mesh.num_nodes()));
}

template <int Dim>
std::shared_ptr<MeshScope<Dim>> ProblemCache<Dim>::scope_of(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh,
                                                            const ChordLevels& chords) {
  if (!scope || !scope->is_of(setup, mesh, chords)) scope = std::make_shared<MeshScope<Dim>>(setup, mesh, chords);
  return scope;
}

template struct MeshScope<2>;
template struct MeshScope<3>;
template struct ProblemCache<2>;
template struct ProblemCache<3>;

}  // namespace itr
