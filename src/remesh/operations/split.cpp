// SPDX-License-Identifier: MIT
#include <algorithm>
#include <span>

#include "itr/remesh/edits.hpp"
#include "remesh/schedule/wave.hpp"

namespace itr {

namespace {

template <int Dim>
class Splitter {
 public:
  explicit Splitter(RemeshSession<Dim>& session)
      : session_(session),
        ask_(session.ask()),
        options_(ask_.options().split),
        tolerance_(options_.acceptance_tolerance.value()),
        count_(session.report().splits) {}

  // Most promising first. (The paper orders by energy density; this gains a fifth more with the same tolerance, or the same
  // with fewer vertices: verification/paper.)
  std::optional<EdgeQueue::Entry> rank(const EdgeKey& edge, LocalScratch<Dim>& scratch) const {
    if (session_.memory().depth(edge) >= options_.max_depth) return std::nullopt;
    if (!session_.culling().may_split(edge)) return std::nullopt;
    const double gain = ask_.predict_split(edge);
    const bool in_contact = ask_.is_in_contact(edge, scratch);
    if (session_.memory().was_refused(RemeshMemory::split, edge, gain, in_contact)) return std::nullopt;
    return EdgeQueue::Entry{
        .edge = edge, .priority = gain, .is_hopeless = !in_contact && is_hopeless(ask_.mesh().cells_of_edge(edge), gain)};
  }

  void look(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const {
    const EdgeKey& edge = trial.edge();
    if (const Refusal refusal = refuse(edge); refusal != Refusal::none) return trial.refuse(refusal);
    ask_.find_contact(trial, scratch);
    const bool is_known = session_.is_unchanged(trial.candidate);
    if (is_known && trial.candidate.is_hopeless && !trial.in_contact) return trial.refuse(Refusal::prediction);
    trial.signal = is_known ? trial.candidate.priority : ask_.predict_split(edge);
    trial.edit = make_split(ask_.mesh(), edge);
    if (!trial.in_contact && is_hopeless(trial.edit->removed_cells, trial.signal))  // there trials tell
      return trial.refuse(Refusal::prediction);
    ask_.judge(trial, tolerance_, ask_.options().local, scratch);
  }

  void settle(Trial<Dim>& trial, std::vector<EdgeKey>& fresh) {
    count_.note(trial.verdict.refusal);
    if (!trial.is_asked) return note_refused(trial.signal);
    if (!session_.commits().commit(trial, count_)) {
      note_refused(trial.verdict.gain);
      return remember(trial);
    }
    const VertexId created = ask_.mesh().vertex_slots() - 1;
    inherit(trial.edge(), created);
    const auto near = edges_of<Dim>(ask_.mesh(), ask_.mesh().cells_of(created));
    fresh.insert(fresh.end(), near.begin(), near.end());
  }

  /// Counts what look would have: in free flight all edges are hopeless, and nothing is asked.
  void pass_over(std::span<const EdgeQueue::Entry> entries) {
    for (const EdgeQueue::Entry& entry : entries) {
      const Refusal refusal = refuse(entry.edge);
      count_.note(refusal == Refusal::none ? Refusal::prediction : refusal);
      note_refused(entry.priority);
    }
  }

 private:
  Refusal refuse(const EdgeKey& edge) const {
    return session_.memory().depth(edge) >= options_.max_depth ? Refusal::depth : ask_.refuse_split(edge);
  }
  void note_refused(double gain) {
    double& best = session_.report().best_refused_gain;
    if (gain > best) best = gain;
  }
  bool is_hopeless(std::span<const CellId> cells, double gain) const { return ask_.is_hopeless(cells, gain, tolerance_); }

  /// Bulk terms alone tell when a refused split can have become worthwhile; in contact any change may have done it.
  void remember(const Trial<Dim>& trial) {
    const double signal = trial.signal, gain = trial.verdict.gain;
    RemeshMemory::SignalRange range{signal / kSameSignal, signal * kSameSignal, trial.in_contact};
    if (!trial.in_contact) {
      constexpr double kMargin = 1.3;
      range.least = 0;
      if (gain > 0) range.most = signal * std::max(kSameSignal, ask_.context().scaling * tolerance_ / (kMargin * gain));
    }
    session_.memory().remember(RemeshMemory::split, trial.edge(), range);
  }

  /// Rank and depth of the edges at the new vertex.
  void inherit(const EdgeKey& edge, VertexId created) {
    const int generation = session_.memory().depth(edge) + 1;
    const auto ring = ask_.mesh().cells_of(created);
    for (const EdgeKey& near : edges_of<Dim>(ask_.mesh(), ring)) {
      if (near[0] != created && near[1] != created) continue;
      session_.culling().inherit(edge, near);
      session_.memory().set_depth(near, generation);
    }
  }

  RemeshSession<Dim>& session_;
  const RemeshQueries<Dim>& ask_;
  const SplitOptions& options_;
  double tolerance_;  ///< [J]
  OperationCount& count_;
};

}  // namespace

template <int Dim>
void split_edges(RemeshSession<Dim>& session) {
  Splitter<Dim> splitter(session);
  run_waves(session, splitter, session.ask().mesh().edges());
  session.memory().forget_depths();
}

template void split_edges(RemeshSession<2>&);
template void split_edges(RemeshSession<3>&);

}  // namespace itr
