// SPDX-License-Identifier: MIT
// Curved edges become straight where that costs next to nothing: what their nodes forget of the history counts.
#include <cmath>
#include <limits>

#include "remesh/edits.hpp"
#include "remesh/schedule/wave.hpp"

namespace itr {

namespace {

template <int Dim>
class Straightener {
 public:
  explicit Straightener(RemeshSession<Dim>& session)
      : session_(session),
        ask_(session.ask()),
        tolerance_(
            ask_.options().straighten.acceptance_tolerance.value_or(ask_.options().collapse.acceptance_tolerance.value())),
        count_(session.report().straightens) {}

  /// The cheapest first.
  std::optional<PlaceQueue::Entry> rank(const Place& place, LocalScratch<Dim>& scratch) const {
    const EdgeKey edge = place.edge();
    if (ask_.refuse_straighten(edge) != Refusal::none) return std::nullopt;
    const double gain = ask_.predict_straighten(edge, scratch);
    const bool in_contact = ask_.is_in_contact(edge, scratch);
    if (session_.memory().was_refused(RemeshMemory::straighten, edge, std::abs(gain), in_contact)) return std::nullopt;
    return PlaceQueue::Entry{.place = place, .priority = gain};
  }

  void look(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const {
    const EdgeKey edge = trial.edge();
    if (const Refusal refusal = ask_.refuse_straighten(edge); refusal != Refusal::none) return trial.refuse(refusal);
    ask_.find_contact(trial, scratch);
    const double gain =
        session_.is_unchanged(trial.candidate) ? trial.candidate.priority : ask_.predict_straighten(edge, scratch);
    trial.signal = std::abs(gain);
    trial.edit = make_straighten(ask_.mesh(), edge);
    if (!trial.in_contact && ask_.is_hopeless(trial.edit->removed_cells, gain, tolerance_))
      return trial.refuse(Refusal::prediction);
    ask_.judge(trial, tolerance_, ask_.options().local, scratch);
  }

  void settle(Trial<Dim>& trial, std::vector<Place>& fresh) {
    count_.note(trial.verdict.refusal);
    if (!trial.is_asked) return;
    if (session_.commits().commit(trial, count_)) {
      const auto changed = std::span<const CellId>(trial.verdict.patch).last(trial.edit->inserted_cells.size());
      const auto near = edges_of<Dim>(ask_.mesh(), changed);
      fresh.insert(fresh.end(), near.begin(), near.end());
      return;
    }
    if (trial.verdict.refusal == Refusal::invalid) return;              // the history decided
    constexpr double kNever = std::numeric_limits<double>::infinity();  // a rounder edge loses more
    session_.memory().remember(
        RemeshMemory::straighten, trial.edge(),
        {trial.signal / kSameSignal, trial.in_contact ? trial.signal * kSameSignal : kNever, trial.in_contact});
  }

 private:
  RemeshSession<Dim>& session_;
  const RemeshQueries<Dim>& ask_;
  double tolerance_;  ///< [J]
  OperationCount& count_;
};

}  // namespace

template <int Dim>
void straighten_edges(RemeshSession<Dim>& session) {
  Straightener<Dim> straightener(session);
  std::vector<Place> edges;
  for (const auto& [edge, node] : session.ask().mesh().nodes()) edges.emplace_back(edge);
  run_waves(session, straightener, std::move(edges));
}

template void straighten_edges(RemeshSession<2>&);
template void straighten_edges(RemeshSession<3>&);

}  // namespace itr
