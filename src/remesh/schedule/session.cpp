// SPDX-License-Identifier: MIT
#include "session.hpp"

#include <algorithm>

#include "itr/core/check.hpp"
#include "itr/mesh/validate.hpp"
#include "itr/remesh/edits.hpp"

namespace itr {

template <int Dim>
RemeshSession<Dim>::RemeshSession(Mesh<Dim>& mesh, RemeshFields<Dim>& fields, const StepContext<Dim>& context,
                                  const RemeshOptions& options, const RemeshMemory& memory, Strata<Dim>& strata)
    : gate_(mesh, fields, context),
      log_(mesh, fields.x, context.contact.enabled),
      ask_(mesh, fields, context, options, strata, gate_),
      memory_(memory, options.screening, log_),
      commits_(mesh, gate_, log_),
      lanes_(context.host.empty() ? num_threads() : 1) {  // terms of the program may not be for several threads
  if (strata.empty()) strata = Strata<Dim>(mesh);
  ITR_AUDIT(strata.find_defect(mesh).empty(), strata.find_defect(mesh));
  log_.add_follower([&](const Change<Dim>& change) {
    fields.make_room(mesh.vertex_slots());
    fields.follow(change.edit, change.created, change.first_node);
    for (const auto& [v, x] : change.positions) fields.x.template segment<Dim>(Dim * v) = x;
  });
  log_.add_follower([&](const Change<Dim>& change) {  // reads the positions of the follower before
    gate_.follow(change.edit, change.first_facet);
    if (context.contact.enabled)
      for (const auto& [v, x] : change.positions) gate_.move(v);
  });
  log_.add_follower([&](const Change<Dim>& change) { strata.follow(change.edit, change.created); });
  log_.add_follower([&](const Change<Dim>& change) { memory_.follow(mesh, change); });
  log_.add_follower([&](const Change<Dim>&) {
    ITR_AUDIT(mesh.find_defect().empty(), mesh.find_defect());
    ITR_AUDIT(mesh.has_nodes() || find_inverted<Dim>(mesh, fields.x) == kNone);
  });
}

template <int Dim>
bool RemeshSession<Dim>::shape_matters(const EdgeKey& e, double roughness) const {
  if (!ask_.screens() || roughness >= ask_.context().scaling * ask_.least_worthwhile() || memory_.was_gain(e)) return true;
  const Mesh<Dim>& mesh = ask_.mesh();
  const auto around = mesh.cells_of(e[0]);
  return std::any_of(around.begin(), around.end(), [&](CellId c) {
    const auto& cell = mesh.cell(c);
    return (e[1] == kNone || std::find(cell.begin(), cell.end(), e[1]) != cell.end()) &&
           mesh.quality(c) < QualityRule{}.floor;
  });
}

template class RemeshSession<2>;
template class RemeshSession<3>;

}  // namespace itr
