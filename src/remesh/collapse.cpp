// SPDX-License-Identifier: MIT
#include <algorithm>
#include <cmath>
#include <limits>

#include "itr/remesh/edits.hpp"
#include "session.hpp"

namespace itr {

std::optional<Edit<2>> collapse_of(const RemeshSession<2>& session, const EdgeKey& edge) {
  return make_collapse(session.mesh(), edge);
}
std::optional<Edit<3>> collapse_of(const RemeshSession<3>& session, const EdgeKey& edge) {
  return propose_collapse(session.mesh(), session.strata(), edge).edit;
}

namespace {

constexpr double kTinyEdge = 1e-3;  ///< in shortest initial edges: shorter ones may collapse whatever their rank

template <int Dim>
class Collapser {
 public:
  Collapser(RemeshSession<Dim>& session, const EdgeRanks& ranks)
      : session_(session), options_(session.options().collapse), ranks_(ranks) {}

  void run() {
    for (const EdgeKey& edge : session_.mesh().edges()) push(edge);
    while (const auto edge = queue_.pop()) {
      if (session_.is_cancelled()) return;
      if (!session_.may_be_collapsed(*edge) || session_.depth(*edge) >= options_.max_depth) continue;
      const double signal = session_.roughness(*edge);
      const bool in_contact = session_.is_in_contact(*edge);
      if (session_.was_refused(RemeshMemory::collapse, *edge, signal, in_contact)) continue;
      const Decision decision = collapse(*edge);
      if (decision != Decision::by_bound && decision != Decision::by_energy) continue;
      constexpr double kNever = std::numeric_limits<double>::infinity();  // a rougher field loses more
      session_.remember(RemeshMemory::collapse, *edge,
                        {signal / kSameSignal, in_contact ? signal * kSameSignal : kNever, in_contact});
    }
    session_.forget_depths();
  }

 private:
  /// Shortest first.
  void push(const EdgeKey& edge) {
    if (is_candidate(edge)) queue_.push(edge, -session_.rest_length(edge));
  }

  bool is_candidate(const EdgeKey& edge) const {
    if (session_.options().screening != Screening::energy_percentile) return true;
    const auto it = ranks_.find(edge);
    return (it != ranks_.end() && it->second == Rank::bottom) ||
           session_.rest_length(edge) < kTinyEdge * session_.context().shortest_edge;
  }

  Decision collapse(const EdgeKey& edge) {
    ++session_.report().collapses.tried;
    const auto edit = collapse_of(session_, edge);
    if (!edit) return Decision::by_gate;
    if (!session_.is_in_contact(edge) && session_.is_hopeless(*edit, session_.predict(*edit), options_.acceptance_tolerance))
      return Decision::by_bound;
    const int generation = session_.depth(edge) + 1;
    const auto verdict = session_.attempt(*edit, edit->value->rest, options_.acceptance_tolerance);
    session_.report().collapses.relaxed += verdict.was_relaxed;
    if (!verdict.accepted()) return verdict.decision;
    ++session_.report().collapses.accepted;
    const VertexId kept = edit->value->vertex;
    for (const EdgeKey& near : session_.edges_of(session_.mesh().cells_of(kept))) {
      if (near[0] == kept || near[1] == kept) session_.set_depth(near, generation);
      push(near);
    }
    return Decision::accepted;
  }

  RemeshSession<Dim>& session_;
  const CollapseOptions& options_;
  const EdgeRanks& ranks_;
  EdgeQueue queue_;
};

}  // namespace

template <int Dim>
void collapse_edges(RemeshSession<Dim>& session, const EdgeRanks& ranks) {
  Collapser<Dim>(session, ranks).run();
}

template void collapse_edges(RemeshSession<2>&, const EdgeRanks&);
template void collapse_edges(RemeshSession<3>&, const EdgeRanks&);

}  // namespace itr
