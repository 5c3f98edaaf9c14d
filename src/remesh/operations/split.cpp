// SPDX-License-Identifier: MIT
// Splits and curves, in one queue by what they are predicted to gain for each node that they add.
#include <algorithm>
#include <span>

#include "remesh/edits.hpp"
#include "remesh/schedule/wave.hpp"

namespace itr {

namespace {

template <int Dim>
class Refiner {
 public:
  explicit Refiner(RemeshSession<Dim>& session)
      : session_(session),
        ask_(session.ask()),
        options_(ask_.options().split),
        tolerance_(options_.acceptance_tolerance.value()),
        curve_tolerance_(ask_.options().curve_tolerance()) {}

  /// These edges and, where curves are enabled, their nodes.
  std::vector<Place> candidates(const std::vector<EdgeKey>& edges) const {
    const bool curves = ask_.options().curve.enabled;
    std::vector<Place> found;
    found.reserve(curves ? 2 * edges.size() : edges.size());
    if (options_.enabled || !curves) found.assign(edges.begin(), edges.end());
    if (curves)
      for (const EdgeKey& edge : edges) found.push_back(Place::node_of(edge));
    return found;
  }

  // Most promising first. (The paper orders by energy density; this gains a fifth more with the same tolerance, or the same
  // with fewer vertices: verification/paper.)
  std::optional<PlaceQueue::Entry> rank(const Place& place, LocalScratch<Dim>& scratch) const {
    const EdgeKey edge = place.edge();
    if (place.is_node()) return rank_curve(edge, scratch);
    if (session_.memory().depth(edge) >= options_.max_depth) return std::nullopt;
    if (const auto* baseline = session_.baseline(); baseline && !baseline->may_split(edge)) return std::nullopt;
    const double gain = ask_.predict_split(edge, scratch);
    const bool in_contact = ask_.is_in_contact(edge, scratch);
    if (session_.memory().was_refused(RemeshMemory::split, edge, gain, in_contact)) return std::nullopt;
    return PlaceQueue::Entry{.place = place,
                             .priority = gain / nodes_of_split(ask_.mesh(), edge),
                             .is_hopeless = ask_.is_hopeless(ask_.mesh().cells_of_edge(edge), gain, tolerance_, in_contact)};
  }

  void look(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const {
    const EdgeKey edge = trial.edge();
    if (trial.candidate.place.is_node()) return look_at_curve(trial, scratch);
    if (const Refusal refusal = refuse(edge); refusal != Refusal::none) return trial.refuse(refusal);
    ask_.find_contact(trial, scratch);
    const bool is_known = session_.is_unchanged(trial.candidate);
    if (is_known && trial.candidate.is_hopeless) return trial.refuse(Refusal::prediction);
    trial.predicted = trial.signal = is_known ? trial.candidate.priority * nodes_of_split(ask_.mesh(), edge)
                                              : ask_.predict_split(edge, scratch, &trial.surface_read);
    trial.edit = make_split(ask_.mesh(), edge);
    if (ask_.is_hopeless(trial.edit->removed_cells, trial.signal, tolerance_, trial.in_contact))
      return trial.refuse(Refusal::prediction);
    ask_.judge(trial, tolerance_, ask_.options().local, scratch);
  }

  void settle(Trial<Dim>& trial, std::vector<Place>& fresh) {
    const bool curves = trial.candidate.place.is_node();
    OperationCount& count = curves ? session_.report().curves : session_.report().splits;
    count.note(trial.verdict.refusal);
    if (!trial.is_asked) {
      if (!curves) note_refused(trial.signal);
      return;
    }
    if (!session_.commits().commit(trial, count)) {
      if (!curves) note_refused(trial.verdict.gain - noise_in(trial.verdict, tolerance_));
      return remember(trial, curves);
    }
    auto changed = std::span<const CellId>(trial.verdict.patch).last(trial.edit->inserted_cells.size());
    if (!curves) {
      const VertexId created = ask_.mesh().node_slots() - 1 - static_cast<int>(trial.edit->inserted_nodes.size());
      inherit(trial.edge(), created);
      changed = ask_.mesh().cells_of(created);
    }
    const auto near = candidates(edges_of<Dim>(ask_.mesh(), changed));
    fresh.insert(fresh.end(), near.begin(), near.end());
  }

  /// Counts what look would have: in free flight all edges are hopeless, and nothing is asked.
  void pass_over(std::span<const PlaceQueue::Entry> entries) {
    for (const PlaceQueue::Entry& entry : entries) {
      const bool curves = entry.place.is_node();
      const Refusal refusal =
          curves ? ask_.refuse_curve(entry.place.edge(), session_.scratch()) : refuse(entry.place.edge());
      OperationCount& count = curves ? session_.report().curves : session_.report().splits;
      count.note(refusal == Refusal::none ? Refusal::prediction : refusal);
      if (!curves) note_refused(entry.priority * nodes_of_split(ask_.mesh(), entry.place.edge()));
    }
  }

 private:
  std::optional<PlaceQueue::Entry> rank_curve(const EdgeKey& edge, LocalScratch<Dim>& scratch) const {
    if (ask_.refuse_curve(edge, scratch) != Refusal::none) return std::nullopt;
    if (const auto* baseline = session_.baseline(); baseline && !baseline->may_split(edge)) return std::nullopt;
    const double gain = ask_.predict_curve(edge, scratch);
    const bool in_contact = ask_.is_in_contact(edge, scratch);
    if (session_.memory().was_refused(RemeshMemory::curve, edge, gain, in_contact)) return std::nullopt;
    return PlaceQueue::Entry{
        .place = Place::node_of(edge),
        .priority = gain,
        .is_hopeless = ask_.is_hopeless(ask_.mesh().cells_of_edge(edge), gain, curve_tolerance_, in_contact)};
  }

  void look_at_curve(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const {
    const EdgeKey edge = trial.edge();
    if (!ask_.exists(edge)) return trial.refuse(Refusal::gone);
    ask_.find_contact(trial, scratch);  // first: the refusal reads the surface, too
    if (const Refusal refusal = ask_.refuse_curve(edge, scratch); refusal != Refusal::none) return trial.refuse(refusal);
    const bool is_known = session_.is_unchanged(trial.candidate);
    if (is_known && trial.candidate.is_hopeless) return trial.refuse(Refusal::prediction);
    trial.predicted = trial.signal =
        is_known ? trial.candidate.priority : ask_.predict_curve(edge, scratch, &trial.surface_read);
    trial.edit = make_curve(ask_.mesh(), edge);
    if (ask_.is_hopeless(trial.edit->removed_cells, trial.signal, curve_tolerance_, trial.in_contact))
      return trial.refuse(Refusal::prediction);
    ask_.judge(trial, curve_tolerance_, ask_.options().local, scratch);
  }

  Refusal refuse(const EdgeKey& edge) const {
    return session_.memory().depth(edge) >= options_.max_depth ? Refusal::depth : ask_.refuse_split(edge);
  }
  void note_refused(double gain) {
    double& best = session_.report().best_refused_gain;
    if (gain > best) best = gain;
  }

  /// Part of the required gain that the barrier may feign.
  double noise_in(const Verdict<Dim>& verdict, double tolerance) const {
    return std::max(0.0, verdict.required - ask_.context().scaling * tolerance);
  }

  /// Bulk terms alone tell when a refused split can have become worthwhile; in contact any change may have done it.
  void remember(const Trial<Dim>& trial, bool curves) {
    if (trial.verdict.refusal == Refusal::invalid) return;  // the history decided
    const double tolerance = curves ? curve_tolerance_ : tolerance_;
    const double signal = trial.signal, gain = trial.verdict.gain;
    constexpr double kMargin = 1.3;
    RemeshMemory::SignalRange range{signal / kSameSignal, signal * kSameSignal, trial.in_contact};
    if (!trial.in_contact && trial.verdict.refusal != Refusal::shape) {  // another function may be less distorted
      range.least = 0;
      if (gain > 0) range.most = signal * std::max(kSameSignal, ask_.context().scaling * tolerance / (kMargin * gain));
    }
    if (trial.in_contact && noise_in(trial.verdict, tolerance) > trial.verdict.required / 2) {
      // The barrier feigns more as its energy grows, and so does the signal.
      constexpr double kMostLonger = 10;
      const double short_of = gain > 0 ? trial.verdict.required / (kMargin * gain) : kMostLonger;
      range.least = 0;
      range.most = signal * std::clamp(short_of, kSameSignal, kMostLonger);
    }
    session_.memory().remember(curves ? RemeshMemory::curve : RemeshMemory::split, trial.edge(), range);
  }

  /// Rank and depth of the edges at the new vertex.
  void inherit(const EdgeKey& edge, VertexId created) {
    const int generation = session_.memory().depth(edge) + 1;
    const auto ring = ask_.mesh().cells_of(created);
    for (const EdgeKey& near : edges_of<Dim>(ask_.mesh(), ring)) {
      if (near[0] != created && near[1] != created) continue;
      if (session_.baseline()) session_.baseline()->inherit(edge, near);
      session_.memory().set_depth(near, generation);
    }
  }

  RemeshSession<Dim>& session_;
  const RemeshQueries<Dim>& ask_;
  const SplitOptions& options_;
  double tolerance_, curve_tolerance_;  ///< [J]
};

}  // namespace

template <int Dim>
void refine_edges(RemeshSession<Dim>& session) {
  Refiner<Dim> refiner(session);
  run_waves(session, refiner, refiner.candidates(session.ask().mesh().edges()));
  session.memory().forget_depths();
}

template void refine_edges(RemeshSession<2>&);
template void refine_edges(RemeshSession<3>&);

}  // namespace itr
