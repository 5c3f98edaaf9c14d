// SPDX-License-Identifier: MIT
#include "committer.hpp"

#include <algorithm>

namespace itr {

template <int Dim>
bool Committer<Dim>::was_overtaken(const Trial<Dim>& trial) const {
  if (log_.now() == wave_began_) return false;
  const bool reads_past_surface = trial.edit && gate_.moves_surface(*trial.edit);
  const auto surfaces = log_.surfaces(wave_began_);
  if (std::any_of(surfaces.begin(), surfaces.end(), [&](const Box<Dim>& box) {
        return box.min[0] <= box.max[0] && (reads_past_surface || box.overlaps(trial.surface_read));
      }))
    return true;
  return std::any_of(trial.verdict.patch.begin(), trial.verdict.patch.end(), [&](CellId c) {
    const auto& cell = mesh_.cell(c);
    return !mesh_.is_cell_alive(c) ||
           std::any_of(cell.begin(), cell.end(), [&](VertexId v) { return log_.was_written(v, wave_began_); });
  });
}

template <int Dim>
bool Committer<Dim>::commit(Trial<Dim>& trial, OperationCount& count) {
  Verdict<Dim>& verdict = trial.verdict;
  if (trial.was_previewed) trial_seconds_.push_back(trial.seconds);
  ++count.tried;
  count.relaxed += verdict.was_relaxed;
  count.accepted += verdict.accepted();
  if (!verdict.accepted()) return false;
  const Change<Dim> change = log_.commit(*trial.edit, verdict.positions);
  verdict.patch.insert(verdict.patch.end(), change.cells.begin(), change.cells.end());
  return true;
}

template <int Dim>
bool Committer<Dim>::commit_unjudged(const Edit<Dim>& edit, GateScratch<Dim>& scratch, OperationCount& count) {
  if (!gate_.passes(edit, scratch)) {
    count.note(Refusal::invalid);
    return false;
  }
  log_.commit(edit, {});
  ++count.accepted;
  return true;
}

template <int Dim>
double Committer<Dim>::median_trial_seconds() {
  if (trial_seconds_.empty()) return 0;
  const auto middle = trial_seconds_.begin() + static_cast<std::ptrdiff_t>(trial_seconds_.size() / 2);
  std::nth_element(trial_seconds_.begin(), middle, trial_seconds_.end());
  return *middle;
}

template class Committer<2>;
template class Committer<3>;

}  // namespace itr
