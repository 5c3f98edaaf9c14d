// SPDX-License-Identifier: MIT
#include "session.hpp"

#include <algorithm>

#include "core/check.hpp"
#include "fem/inverted.hpp"
#include "remesh/edits.hpp"

namespace itr {

template <int Dim>
SessionMemory<Dim>::SessionMemory(const RemeshMemory& memory, bool remembers, const ChangeLog<Dim>& log)
    : log_(log), remembers_(remembers) {
  refused_.reserve(2 * memory.refusals.size());
  for (const auto& [candidate, range] : memory.refusals) refused_.emplace(candidate, range);
}

template <int Dim>
void SessionMemory<Dim>::follow(const Mesh<Dim>& mesh, const Change<Dim>& change) {
  for (const EdgeKey& edge : edges_of<Dim>(mesh, change.cells))
    for (int kind = 0; kind < kOperationKinds; ++kind) refused_.erase(Candidate(static_cast<OperationKind>(kind), edge));
  if constexpr (Dim == 3)
    for (const CellId c : change.cells)
      for (int k = 0; k <= Dim; ++k)
        refused_.erase(Candidate(OperationKind::remove_facet, opposite_facet<3>(mesh.cell(c), k)));
}

template <int Dim>
std::vector<RemeshMemory::Entry> SessionMemory<Dim>::remembered(const RemeshQueries<Dim>& queries) const {
  std::vector<RemeshMemory::Entry> refusals;
  for (const auto& [candidate, range] : refused_)
    if (queries.exists(candidate)) refusals.push_back({candidate, range});
  std::ranges::sort(refusals, {}, &RemeshMemory::Entry::candidate);
  return refusals;
}

template class SessionMemory<2>;
template class SessionMemory<3>;

template <int Dim>
RemeshSession<Dim>::RemeshSession(Mesh<Dim>& mesh, RemeshFields<Dim>& fields, const StepContext<Dim>& context,
                                  const RemeshOptions& options, std::unique_ptr<Baseline<Dim>> baseline,
                                  RemeshMemory& memory, Strata<Dim>& strata)
    : baseline_(std::move(baseline)),
      fields_(fields),
      stored_(memory),
      gate_(mesh, fields, context),
      log_(mesh, fields.x, context.contact.enabled),
      patches_(any_averages_volume(context.materials)
                   ? std::make_unique<CarriedPatches<Dim>>(mesh, fields.x, context.materials)
                   : nullptr),
      queries_(mesh, fields, context, options, strata, gate_, baseline_.get(), patches_.get()),
      memory_(memory, !baseline_ || baseline_->has_bounds(), log_),
      lanes_(context.host.empty() ? num_threads() : 1) {  // terms of the program may not be for several threads
  if (strata.empty()) strata = Strata<Dim>(mesh);
  ITR_AUDIT(strata.find_defect(mesh).empty(), strata.find_defect(mesh));
  log_.add_follower([&](const Change<Dim>& change) {
    fields.make_room(mesh.node_slots());
    fields.follow(change.edit, change.created, change.first_node);
    for (const auto& [v, x] : change.positions) fields.x.template segment<Dim>(Dim * v) = x;
  });
  if (patches_) carry_patches(mesh);
  log_.add_follower([&](const Change<Dim>& change) {  // reads the positions of the follower before
    gate_.follow(change.edit, change.first_facet);
    if (context.contact.enabled)
      for (const auto& [v, x] : change.positions) gate_.move(v);
  });
  log_.add_follower([&](const Change<Dim>& change) { strata.follow(change.edit, change.created); });
  log_.add_follower([&](const Change<Dim>& change) { memory_.follow(mesh, change); });
  log_.add_follower([&](const Change<Dim>&) {
    ITR_AUDIT(mesh.find_defect().empty(), mesh.find_defect());
    ITR_AUDIT(find_inverted(mesh, fields.x) == kNone, find_inverted(mesh, fields.x));
    for ([[maybe_unused]] const VectorX& past : fields.past_positions) ITR_AUDIT(find_inverted(mesh, past) == kNone);
  });
}

/// Follows the positions of the first follower.
template <int Dim>
void RemeshSession<Dim>::carry_patches(const Mesh<Dim>& mesh) {
  log_.add_forerunner([&](const Edit<Dim>& edit) { shares_ = patches_->shares_after(mesh, edit); });
  log_.add_follower([&](const Change<Dim>& change) {
    std::vector<VertexId> moved;
    for (const auto& [v, x] : change.positions) moved.push_back(v);
    patches_->follow(mesh, change.edit, std::move(shares_), change.cells, moved, fields_.x, log_.now());
  });
}

template <int Dim>
bool RemeshSession<Dim>::commit_unjudged(const Edit<Dim>& edit, OperationCount& count) {
  if (!gate_.passes(edit, scratch().gate)) {
    count.note(Refusal::invalid);
    return false;
  }
  log_.commit(edit, {});
  ++count.accepted;
  return true;
}

template <int Dim>
RemeshReport RemeshSession<Dim>::finish() {
  fields_.trim(queries_.mesh().node_slots());
  stored_.refusals = memory_.remembered(queries_);
  if (trial_seconds_.empty()) return report_;
  const auto middle = trial_seconds_.begin() + static_cast<std::ptrdiff_t>(trial_seconds_.size() / 2);
  std::nth_element(trial_seconds_.begin(), middle, trial_seconds_.end());
  report_.trial_seconds = *middle;
  return report_;
}

template <int Dim>
bool RemeshSession<Dim>::shape_matters(const Candidate& candidate, double roughness) const {
  if (roughness >= queries_.context().scaling * queries_.least_worthwhile() || memory_.was_gain(candidate)) return true;
  const Mesh<Dim>& mesh = queries_.mesh();
  const auto around = mesh.cells_of(candidate.vertices().front());
  return std::any_of(around.begin(), around.end(), [&](CellId c) {
    const auto& cell = mesh.cell(c);
    return std::find(cell.begin(), cell.end(), candidate.vertices().back()) != cell.end() &&
           mesh.quality(c) < QualityRule{}.floor;
  });
}

template class RemeshSession<2>;
template class RemeshSession<3>;

}  // namespace itr
