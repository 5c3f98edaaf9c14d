// SPDX-License-Identifier: MIT
#include <algorithm>
#include <span>

#include "itr/remesh/edits.hpp"
#include "wave.hpp"

namespace itr {

namespace {

template <int Dim>
class Splitter {
 public:
  Splitter(RemeshSession<Dim>& session, EdgeRanks& ranks)
      : session_(session),
        options_(session.options().split),
        tolerance_(options_.acceptance_tolerance.value()),
        ranks_(ranks) {}

  // Most promising first. (The paper orders by energy density; this gains a fifth more with the same tolerance, or the same
  // with fewer vertices: verification/paper.)
  std::optional<EdgeQueue::Entry> rank(const EdgeKey& edge, LocalScratch<Dim>& scratch) const {
    if (session_.depth(edge) >= options_.max_depth) return std::nullopt;
    if (is_culled() && inherited(edge) != Rank::top) return std::nullopt;
    const double gain = session_.predict_split(edge);
    const bool in_contact = session_.is_in_contact(edge, scratch);
    if (session_.was_refused(RemeshMemory::split, edge, gain, in_contact)) return std::nullopt;
    return EdgeQueue::Entry{.edge = edge,
                            .priority = gain,
                            .is_hopeless = !in_contact && is_hopeless(session_.mesh().cells_of_edge(edge), gain)};
  }

  void look(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const {
    const EdgeKey& edge = trial.edge();
    if (!session_.exists(edge) || session_.depth(edge) >= options_.max_depth ||
        !session_.may_be_split(edge, trial.is_bound_by_dhat))
      return;
    session_.find_contact(trial, scratch);
    const bool is_known = session_.is_unchanged(trial.candidate);
    if (is_known && trial.candidate.is_hopeless && !trial.in_contact) return;
    trial.signal = is_known ? trial.candidate.priority : session_.predict_split(edge);
    trial.edit = make_split(session_.mesh(), edge);
    if (!trial.in_contact && is_hopeless(trial.edit->removed_cells, trial.signal)) return;  // there trials tell
    session_.judge(trial, trial.edit->value->rest, tolerance_, session_.options().local, scratch);
  }

  void settle(Trial<Dim>& trial, std::vector<EdgeKey>& fresh) {
    session_.report().bound_by_activation_distance += trial.is_bound_by_dhat;
    if (!trial.is_asked) return note_refused(trial.signal);
    if (!session_.commit(trial, session_.report().splits)) {
      note_refused(trial.verdict.gain);
      return remember(trial);
    }
    const VertexId created = session_.mesh().vertex_slots() - 1;
    inherit(trial.edge(), created);
    const auto near = session_.edges_of(session_.mesh().cells_of(created));
    fresh.insert(fresh.end(), near.begin(), near.end());
  }

  /// Counts what look would have: in free flight all edges are hopeless, and nothing is asked.
  void pass_over(std::span<const EdgeQueue::Entry> entries) {
    for (const EdgeQueue::Entry& entry : entries) {
      bool is_bound_by_dhat = false;
      session_.may_be_split(entry.edge, is_bound_by_dhat);
      session_.report().bound_by_activation_distance += is_bound_by_dhat;
      note_refused(entry.priority);
    }
  }

 private:
  bool is_culled() const { return session_.options().screening == Screening::energy_percentile; }
  void note_refused(double gain) {
    double& best = session_.report().best_refused_gain;
    if (gain > best) best = gain;
  }
  bool is_hopeless(std::span<const CellId> cells, double gain) const {
    return session_.is_hopeless(cells, gain, tolerance_);
  }

  Rank inherited(const EdgeKey& edge) const {
    const auto it = ranks_.find(edge);
    return it == ranks_.end() ? Rank::middle : it->second;
  }

  /// Bulk terms alone tell when a refused split can have become worthwhile; in contact any change may have done it.
  void remember(const Trial<Dim>& trial) {
    const double signal = trial.signal, gain = trial.verdict.gain;
    RemeshMemory::Refusal refusal{signal / kSameSignal, signal * kSameSignal, trial.in_contact};
    if (!trial.in_contact) {
      constexpr double kMargin = 1.3;
      refusal.least_signal = 0;
      if (gain > 0)
        refusal.most_signal = signal * std::max(kSameSignal, session_.context().scaling * tolerance_ / (kMargin * gain));
    }
    session_.remember(RemeshMemory::split, trial.edge(), refusal);
  }

  /// Rank and depth of the edges at the new vertex.
  void inherit(const EdgeKey& edge, VertexId created) {
    const Rank from = inherited(edge);
    const int generation = session_.depth(edge) + 1;
    const auto ring = session_.mesh().cells_of(created);
    for (const EdgeKey& near : session_.edges_of(ring)) {
      if (near[0] != created && near[1] != created) continue;
      if (is_culled()) ranks_[near] = from;
      session_.set_depth(near, generation);
    }
  }

  RemeshSession<Dim>& session_;
  const SplitOptions& options_;
  double tolerance_;  ///< [J]
  EdgeRanks& ranks_;
};

}  // namespace

template <int Dim>
void split_edges(RemeshSession<Dim>& session, EdgeRanks& ranks) {
  Splitter<Dim> splitter(session, ranks);
  run_waves(session, splitter, session.mesh().edges());
  session.forget_depths();
}

template void split_edges(RemeshSession<2>&, EdgeRanks&);
template void split_edges(RemeshSession<3>&, EdgeRanks&);

}  // namespace itr
