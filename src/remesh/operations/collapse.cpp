// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>

#include "remesh/edits.hpp"
#include "remesh/schedule/wave.hpp"

namespace itr {

namespace {

template <int Dim>
class Collapser {
 public:
  explicit Collapser(RemeshSession<Dim>& session)
      : session_(session),
        ask_(session.ask()),
        options_(ask_.options().collapse),
        tolerance_(options_.acceptance_tolerance.value()) {}

  /// Shortest first.
  std::optional<PlaceQueue::Entry> rank(const Place& place, LocalScratch<Dim>&) const {
    const EdgeKey edge = place.edge();
    if (const auto* baseline = session_.baseline(); baseline && !baseline->may_collapse(edge)) return std::nullopt;
    if (ask_.refuse_collapse(edge) != Refusal::none) return std::nullopt;
    return PlaceQueue::Entry{.place = place, .priority = -ask_.rest_length(edge)};
  }

  void look(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const {
    const EdgeKey edge = trial.edge();
    if (const Refusal refusal = ask_.refuse_collapse(edge); refusal != Refusal::none) return trial.refuse(refusal);
    if (session_.memory().depth(edge) >= options_.max_depth) return trial.refuse(Refusal::depth);
    trial.signal = ask_.roughness(edge);
    ask_.find_contact(trial, scratch);
    if (session_.memory().was_refused(RemeshMemory::collapse, edge, trial.signal, trial.in_contact)) return;
    trial.is_asked = true;
    if (!trial.take(propose_collapse(ask_.mesh(), ask_.strata(), edge))) return;
    if (!trial.in_contact && ask_.is_hopeless(trial.edit->removed_cells, ask_.predict(*trial.edit), tolerance_))
      return trial.refuse(Refusal::prediction);
    ask_.judge(trial, tolerance_, ask_.options().local, scratch);
  }

  void settle(Trial<Dim>& trial, std::vector<Place>& fresh) {
    OperationCount& count = session_.report().collapses;
    count.note(trial.verdict.refusal);
    if (!trial.is_asked) return;
    const int generation = session_.memory().depth(trial.edge()) + 1;
    if (session_.commits().commit(trial, count)) {
      const VertexId kept = trial.edit->value->vertex;
      for (const EdgeKey& near : edges_of<Dim>(ask_.mesh(), ask_.mesh().cells_of(kept))) {
        if (near[0] == kept || near[1] == kept) session_.memory().set_depth(near, generation);
        fresh.push_back(near);
      }
      return;
    }
    const Refusal refusal = trial.verdict.refusal;
    if (refusal != Refusal::prediction && refusal != Refusal::bound && refusal != Refusal::energy) return;
    constexpr double kNever = std::numeric_limits<double>::infinity();  // a rougher field loses more
    session_.memory().remember(
        RemeshMemory::collapse, trial.edge(),
        {trial.signal / kSameSignal, trial.in_contact ? trial.signal * kSameSignal : kNever, trial.in_contact});
  }

 private:
  RemeshSession<Dim>& session_;
  const RemeshQueries<Dim>& ask_;
  const CollapseOptions& options_;
  double tolerance_;  ///< [J]
};

}  // namespace

template <int Dim>
void collapse_edges(RemeshSession<Dim>& session) {
  Collapser<Dim> collapser(session);
  run_waves(session, collapser, places(session.ask().mesh().edges()));
  session.memory().forget_depths();
}

template void collapse_edges(RemeshSession<2>&);
template void collapse_edges(RemeshSession<3>&);

}  // namespace itr
