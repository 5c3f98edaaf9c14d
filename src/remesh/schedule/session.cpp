// SPDX-License-Identifier: MIT
#include "session.hpp"

#include <algorithm>

#include "core/check.hpp"
#include "fem/inverted.hpp"
#include "remesh/edits.hpp"

namespace itr {

template <int Dim>
RemeshSession<Dim>::RemeshSession(Mesh<Dim>& mesh, RemeshFields<Dim>& fields, const StepContext<Dim>& context,
                                  const RemeshOptions& options, std::unique_ptr<Baseline<Dim>> baseline,
                                  const RemeshMemory& memory, Strata<Dim>& strata)
    : baseline_(std::move(baseline)),
      gate_(mesh, fields, context),
      log_(mesh, fields.x, context.contact.enabled),
      ask_(mesh, fields, context, options, strata, gate_, baseline_.get()),
      memory_(memory, !baseline_ || baseline_->has_bounds(), log_),
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
    [[maybe_unused]] const auto inverted = [&](const VectorX& x) {
      return find_inverted(mesh, x, [&](VertexId a, VertexId b) { return mesh.node_of(a, b); });
    };
    ITR_AUDIT(inverted(fields.x) == kNone, inverted(fields.x));
    for ([[maybe_unused]] const VectorX& past : fields.past_positions) ITR_AUDIT(inverted(past) == kNone);
  });
}

template <int Dim>
bool RemeshSession<Dim>::shape_matters(const Place& place, double roughness) const {
  if (roughness >= ask_.context().scaling * ask_.least_worthwhile() || memory_.was_gain(place)) return true;
  const Mesh<Dim>& mesh = ask_.mesh();
  const auto around = mesh.cells_of(place.vertices().front());
  return std::any_of(around.begin(), around.end(), [&](CellId c) {
    const auto& cell = mesh.cell(c);
    return std::find(cell.begin(), cell.end(), place.vertices().back()) != cell.end() &&
           mesh.quality(c) < QualityRule{}.floor;
  });
}

template class RemeshSession<2>;
template class RemeshSession<3>;

}  // namespace itr
