// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>

#include "itr/remesh/edits.hpp"
#include "wave.hpp"

namespace itr {

namespace {

template <int Dim>
class Collapser {
 public:
  Collapser(RemeshSession<Dim>& session, const EdgeRanks& ranks)
      : session_(session),
        options_(session.options().collapse),
        tolerance_(options_.acceptance_tolerance.value()),
        ranks_(ranks) {}

  /// Shortest first.
  std::optional<EdgeQueue::Entry> rank(const EdgeKey& edge, LocalScratch<Dim>&) const {
    if (!is_candidate(edge) || !session_.may_be_collapsed(edge)) return std::nullopt;
    return EdgeQueue::Entry{.edge = edge, .priority = -session_.rest_length(edge)};
  }

  void look(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const {
    const EdgeKey& edge = trial.edge();
    if (!session_.may_be_collapsed(edge) || session_.depth(edge) >= options_.max_depth) return;
    trial.signal = session_.roughness(edge);
    session_.find_contact(trial, scratch);
    if (session_.was_refused(RemeshMemory::collapse, edge, trial.signal, trial.in_contact)) return;
    trial.is_asked = true;
    trial.edit = propose_collapse(session_.mesh(), session_.strata(), edge).edit;
    if (!trial.edit) return;
    if (!trial.in_contact && session_.is_hopeless(*trial.edit, session_.predict(*trial.edit), tolerance_)) {
      trial.verdict.decision = Decision::by_bound;
      return;
    }
    session_.judge(trial, trial.edit->value->rest, tolerance_, session_.options().local, scratch);
  }

  void settle(Trial<Dim>& trial, std::vector<EdgeKey>& fresh) {
    if (!trial.is_asked) return;
    const int generation = session_.depth(trial.edge()) + 1;
    if (session_.commit(trial, session_.report().collapses)) {
      const VertexId kept = trial.edit->value->vertex;
      for (const EdgeKey& near : session_.edges_of(session_.mesh().cells_of(kept))) {
        if (near[0] == kept || near[1] == kept) session_.set_depth(near, generation);
        fresh.push_back(near);
      }
      return;
    }
    const Decision decision = trial.verdict.decision;
    if (decision != Decision::by_bound && decision != Decision::by_energy) return;
    constexpr double kNever = std::numeric_limits<double>::infinity();  // a rougher field loses more
    session_.remember(
        RemeshMemory::collapse, trial.edge(),
        {trial.signal / kSameSignal, trial.in_contact ? trial.signal * kSameSignal : kNever, trial.in_contact});
  }

 private:
  bool is_candidate(const EdgeKey& edge) const {
    if (session_.options().screening != Screening::energy_percentile) return true;
    const auto it = ranks_.find(edge);
    return it != ranks_.end() && it->second == Rank::bottom;
  }

  RemeshSession<Dim>& session_;
  const CollapseOptions& options_;
  double tolerance_;  ///< [J]
  const EdgeRanks& ranks_;
};

}  // namespace

template <int Dim>
void collapse_edges(RemeshSession<Dim>& session, const EdgeRanks& ranks) {
  Collapser<Dim> collapser(session, ranks);
  run_waves(session, collapser, session.mesh().edges());
  session.forget_depths();
}

template void collapse_edges(RemeshSession<2>&, const EdgeRanks&);
template void collapse_edges(RemeshSession<3>&, const EdgeRanks&);

}  // namespace itr
