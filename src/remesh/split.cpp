// SPDX-License-Identifier: MIT
#include <algorithm>

#include "itr/remesh/edits.hpp"
#include "session.hpp"

namespace itr {

namespace {

template <int Dim>
class Splitter {
 public:
  Splitter(RemeshSession<Dim>& session, EdgeRanks& ranks)
      : session_(session),
        options_(session.options().split),
        tolerance_(session.context().scaling * options_.acceptance_tolerance),
        ranks_(ranks) {}

  void run() {
    for (const EdgeKey& edge : session_.mesh().edges()) push(edge);
    while (const auto edge = queue_.pop()) {
      if (session_.is_cancelled()) return;
      if (may_be_split(*edge)) split(*edge);
    }
    session_.forget_depths();
  }

 private:
  double predict(const EdgeKey& edge) const { return session_.predict(make_split(session_.mesh(), edge)); }
  bool is_culled() const { return session_.options().screening == Screening::energy_percentile; }

  // Most promising first. (The paper orders by energy density; this gains a fifth more with the same tolerance, or the same
  // with fewer vertices: verification/paper.)
  void push(const EdgeKey& edge) {
    if (session_.depth(edge) >= options_.max_depth) return;
    if (is_culled() && rank(edge) != Rank::top) return;
    const double gain = predict(edge);
    if (!session_.was_refused(RemeshMemory::split, edge, gain, session_.is_in_contact(edge))) queue_.push(edge, gain);
  }

  Rank rank(const EdgeKey& edge) const {
    const auto it = ranks_.find(edge);
    return it == ranks_.end() ? Rank::middle : it->second;
  }

  bool may_be_split(const EdgeKey& edge) {
    return session_.exists(edge) && session_.depth(edge) < options_.max_depth && session_.may_be_split(edge);
  }

  void split(const EdgeKey& edge) {
    const auto edit = make_split(session_.mesh(), edge);
    const double signal = session_.predict(edit);
    const bool in_contact = session_.is_in_contact(edge);  // there trials tell
    if (!in_contact && session_.is_hopeless(edit, signal, options_.acceptance_tolerance)) return;
    ++session_.report().splits.tried;
    const auto verdict = session_.attempt(edit, edit.value->rest, options_.acceptance_tolerance);
    session_.report().splits.relaxed += verdict.was_relaxed;
    if (!verdict.accepted()) return remember(edge, signal, in_contact, verdict.gain);
    ++session_.report().splits.accepted;
    const VertexId created = session_.mesh().vertex_slots() - 1;
    inherit(edge, created);
    for (const EdgeKey& near : session_.edges_of(session_.mesh().cells_of(created))) push(near);
  }

  /// Bulk terms alone tell when a refused split can have become worthwhile; in contact any change may have done it.
  void remember(const EdgeKey& edge, double signal, bool in_contact, double gain) {
    RemeshMemory::Refusal refusal{signal / kSameSignal, signal * kSameSignal, in_contact};
    if (!in_contact) {
      constexpr double kMargin = 1.3;
      refusal.least_signal = 0;
      if (gain > 0) refusal.most_signal = signal * std::max(kSameSignal, tolerance_ / (kMargin * gain));
    }
    session_.remember(RemeshMemory::split, edge, refusal);
  }

  /// Rank and depth of the edges at the new vertex.
  void inherit(const EdgeKey& edge, VertexId created) {
    const Rank from = rank(edge);
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
  double tolerance_;
  EdgeRanks& ranks_;
  EdgeQueue queue_;
};

}  // namespace

template <int Dim>
void split_edges(RemeshSession<Dim>& session, EdgeRanks& ranks) {
  Splitter<Dim>(session, ranks).run();
}

template void split_edges(RemeshSession<2>&, EdgeRanks&);
template void split_edges(RemeshSession<3>&, EdgeRanks&);

}  // namespace itr
