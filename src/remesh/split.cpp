// SPDX-License-Identifier: MIT
// Splits and curves, in one queue by what they are predicted to gain for each node that they add.
#include <algorithm>
#include <span>

#include "itr/remesh/edits.hpp"
#include "wave.hpp"

namespace itr {

namespace {

/// An edge to be curved stands in the queue with its larger vertex first, one to be split with the smaller.
EdgeKey reversed(const EdgeKey& edge) { return {edge[1], edge[0]}; }
bool is_to_be_curved(const EdgeKey& key) { return key[0] > key[1]; }

void add_reversed(std::vector<EdgeKey>& edges) {
  const std::size_t count = edges.size();
  edges.reserve(2 * count);
  for (std::size_t i = 0; i < count; ++i) edges.push_back(reversed(edges[i]));
}

template <int Dim>
class Refiner {
 public:
  Refiner(RemeshSession<Dim>& session, EdgeRanks& ranks)
      : session_(session),
        options_(session.options().split),
        tolerance_(options_.acceptance_tolerance.value()),
        curve_tolerance_(session.options().curve.acceptance_tolerance.value_or(tolerance_)),
        ranks_(ranks) {}

  /// What there is to ask of these edges.
  std::vector<EdgeKey> candidates(std::vector<EdgeKey> edges) const {
    if (!options_.enabled)
      for (EdgeKey& edge : edges) edge = reversed(edge);
    else if (session_.options().curve.enabled)
      add_reversed(edges);
    return edges;
  }

  // Most promising first. (The paper orders by energy density; this gains a fifth more with the same tolerance, or the same
  // with fewer vertices: verification/paper.)
  std::optional<EdgeQueue::Entry> rank(const EdgeKey& edge, LocalScratch<Dim>& scratch) const {
    if (is_to_be_curved(edge)) return rank_curve(edge, scratch);
    if (session_.depth(edge) >= options_.max_depth) return std::nullopt;
    if (is_culled() && inherited(edge) != Rank::top) return std::nullopt;
    const double gain = session_.predict_split(edge, scratch);
    const bool in_contact = session_.is_in_contact(edge, scratch);
    if (session_.was_refused(RemeshMemory::split, edge, gain, in_contact)) return std::nullopt;
    return EdgeQueue::Entry{
        .edge = edge,
        .priority = gain / nodes_of_split(edge),
        .is_hopeless = !in_contact && is_hopeless(session_.mesh().cells_of_edge(edge), gain, tolerance_)};
  }

  void look(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const {
    const EdgeKey& edge = trial.edge();
    if (is_to_be_curved(edge)) return look_at_curve(trial, scratch);
    if (!session_.exists(edge) || session_.depth(edge) >= options_.max_depth ||
        !session_.may_be_split(edge, trial.is_bound_by_dhat))
      return;
    session_.find_contact(trial, scratch);
    const bool is_known = session_.is_unchanged(trial.candidate);
    if (is_known && trial.candidate.is_hopeless && !trial.in_contact) return;
    trial.signal = is_known ? trial.candidate.priority * nodes_of_split(edge) : session_.predict_split(edge, scratch);
    trial.edit = make_split(session_.mesh(), edge);
    if (!trial.in_contact && is_hopeless(trial.edit->removed_cells, trial.signal, tolerance_)) return;  // there trials tell
    session_.judge(trial, trial.edit->value->rest, tolerance_, session_.options().local, scratch);
  }

  void settle(Trial<Dim>& trial, std::vector<EdgeKey>& fresh) {
    session_.report().bound_by_activation_distance += trial.is_bound_by_dhat;
    if (!trial.is_asked) return note_refused(trial.signal);
    const bool curves = is_to_be_curved(trial.edge());
    if (!session_.commit(trial, curves ? session_.report().curves : session_.report().splits)) {
      note_refused(trial.verdict.gain);
      return remember(trial, curves);
    }
    std::span<const CellId> changed = std::span<const CellId>(trial.verdict.patch).last(trial.edit->inserted_cells.size());
    if (!curves) {
      const VertexId created = session_.mesh().vertex_slots() - 1 - static_cast<int>(trial.edit->inserted_nodes.size());
      inherit(trial.edge(), created);
      changed = session_.mesh().cells_of(created);
    }
    const auto near = candidates(session_.edges_of(changed));
    fresh.insert(fresh.end(), near.begin(), near.end());
  }

  /// Counts what look would have: in free flight all edges are hopeless, and nothing is asked.
  void pass_over(std::span<const EdgeQueue::Entry> entries) {
    for (const EdgeQueue::Entry& entry : entries) {
      bool is_bound_by_dhat = false;
      if (!is_to_be_curved(entry.edge)) session_.may_be_split(entry.edge, is_bound_by_dhat);
      session_.report().bound_by_activation_distance += is_bound_by_dhat;
      note_refused(entry.priority);
    }
  }

 private:
  std::optional<EdgeQueue::Entry> rank_curve(const EdgeKey& key, LocalScratch<Dim>& scratch) const {
    const EdgeKey edge = reversed(key);
    if (!session_.may_be_curved(edge)) return std::nullopt;
    const double gain = session_.predict_curve(edge, scratch);
    if (session_.was_refused(RemeshMemory::curve, edge, gain, false)) return std::nullopt;
    return EdgeQueue::Entry{.edge = key,
                            .priority = gain,
                            .is_hopeless = is_hopeless(session_.mesh().cells_of_edge(edge), gain, curve_tolerance_)};
  }

  void look_at_curve(Trial<Dim>& trial, LocalScratch<Dim>& scratch) const {
    const EdgeKey edge = reversed(trial.edge());
    if (!session_.may_be_curved(edge)) return;
    const bool is_known = session_.is_unchanged(trial.candidate);
    if (is_known && trial.candidate.is_hopeless) return;
    trial.signal = is_known ? trial.candidate.priority : session_.predict_curve(edge, scratch);
    trial.edit = make_curve(session_.mesh(), edge);
    if (is_hopeless(trial.edit->removed_cells, trial.signal, curve_tolerance_)) return;
    const Vec<Dim> center = 0.5 * (session_.mesh().rest(edge[0]) + session_.mesh().rest(edge[1]));
    session_.judge(trial, center, curve_tolerance_, session_.options().local, scratch);
  }

  /// By how many nodes a split enlarges the space.
  double nodes_of_split(const EdgeKey& edge) const {
    if (!session_.mesh().has_nodes()) return 1;
    const Edit<Dim> edit = make_split(session_.mesh(), edge);
    return 1 + static_cast<double>(edit.inserted_nodes.size()) - static_cast<double>(edit.removed_nodes.size());
  }

  bool is_culled() const { return session_.options().screening == Screening::energy_percentile; }
  void note_refused(double gain) {
    double& best = session_.report().best_refused_gain;
    if (gain > best) best = gain;
  }
  bool is_hopeless(std::span<const CellId> cells, double gain, double tolerance) const {
    return session_.is_hopeless(cells, gain, tolerance);
  }

  Rank inherited(const EdgeKey& edge) const {
    const auto it = ranks_.find(edge);
    return it == ranks_.end() ? Rank::middle : it->second;
  }

  /// Bulk terms alone tell when a refused split can have become worthwhile; in contact any change may have done it.
  void remember(const Trial<Dim>& trial, bool curves) {
    const double tolerance = curves ? curve_tolerance_ : tolerance_;
    const double signal = trial.signal, gain = trial.verdict.gain;
    RemeshMemory::Refusal refusal{signal / kSameSignal, signal * kSameSignal, trial.in_contact};
    if (!trial.in_contact) {
      constexpr double kMargin = 1.3;
      refusal.least_signal = 0;
      if (gain > 0)
        refusal.most_signal = signal * std::max(kSameSignal, session_.context().scaling * tolerance / (kMargin * gain));
    }
    session_.remember(curves ? RemeshMemory::curve : RemeshMemory::split, curves ? reversed(trial.edge()) : trial.edge(),
                      refusal);
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
  double tolerance_, curve_tolerance_;  ///< [J]
  EdgeRanks& ranks_;
};

}  // namespace

template <int Dim>
void refine_edges(RemeshSession<Dim>& session, EdgeRanks& ranks) {
  Refiner<Dim> refiner(session, ranks);
  run_waves(session, refiner, refiner.candidates(session.mesh().edges()));
  session.forget_depths();
}

template void refine_edges(RemeshSession<2>&, EdgeRanks&);
template void refine_edges(RemeshSession<3>&, EdgeRanks&);

}  // namespace itr
