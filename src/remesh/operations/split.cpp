// SPDX-License-Identifier: MIT
// Splits and curves, in one queue by what they are predicted to gain for each node that they add. (The paper orders by
// energy density; this gains a fifth more with the same tolerance, or the same with fewer vertices: verification/paper.)
#include <algorithm>

#include "remesh/edits.hpp"
#include "remesh/schedule/pipeline.hpp"

namespace itr {

namespace {

/// Part of the required gain that the barrier may feign.
template <int Dim>
double noise_in(const Trial<Dim>& trial, double scaling) {
  return std::max(0.0, trial.verdict.required - scaling * trial.tolerance);
}

/// Bulk terms alone tell when a refused split can have become worthwhile; in contact any change may have done it.
template <int Dim>
RemeshMemory::KeyRange remember_refinement(const Trial<Dim>& trial, double scaling) {
  constexpr double kMargin = 1.3;
  const double key = trial.key, gain = trial.verdict.gain;
  RemeshMemory::KeyRange range{key / kSameKey, key * kSameKey, trial.in_contact};
  if (!trial.in_contact && trial.verdict.refusal != Refusal::shape) {  // another function may be less distorted
    range.least = 0;
    if (gain > 0) range.most = key * std::max(kSameKey, scaling * trial.tolerance / (kMargin * gain));
  }
  if (trial.in_contact && noise_in(trial, scaling) > trial.verdict.required / 2) {
    // The barrier feigns more as its energy grows, and so does the key.
    constexpr double kMostLonger = 10;
    const double short_of = gain > 0 ? trial.verdict.required / (kMargin * gain) : kMostLonger;
    range.least = 0;
    range.most = key * std::clamp(short_of, kSameKey, kMostLonger);
  }
  return range;
}

template <int Dim>
bool may_refine(const RemeshSession<Dim>& session, const EdgeKey& edge) {
  return !session.baseline() || session.baseline()->may_split(edge);
}

/// Gives rank and depth of a split edge to the edges at the new vertex.
template <int Dim>
void inherit(RemeshSession<Dim>& session, const Trial<Dim>& trial) {
  const Mesh<Dim>& mesh = session.queries().mesh();
  const VertexId created = mesh.node_slots() - 1 - static_cast<int>(trial.edit->inserted_nodes.size());
  const int generation = session.memory().depth(trial.edge()) + 1;
  for (const EdgeKey& near : edges_of<Dim>(mesh, mesh.cells_of(created))) {
    if (near[0] != created && near[1] != created) continue;
    if (session.baseline()) session.baseline()->inherit(trial.edge(), near);
    session.memory().set_depth(near, generation);
  }
}

}  // namespace

template <int Dim>
void refine_edges(RemeshSession<Dim>& session) {
  const RemeshQueries<Dim>& queries = session.queries();
  const Mesh<Dim>& mesh = queries.mesh();
  const RemeshOptions& options = queries.options();
  const double scaling = queries.context().scaling;

  Operation<Dim> split(session, OperationKind::split, &RemeshReport::splits, options.split.acceptance_tolerance.value());
  split.refuse = [&](const Candidate& candidate) {
    if (session.memory().depth(candidate.edge()) >= options.split.max_depth) return Refusal::depth;
    return may_refine(session, candidate.edge()) ? queries.refuse_split(candidate.edge()) : Refusal::not_asked;
  };
  split.num_nodes = [&](const Candidate& candidate) { return nodes_of_split(mesh, candidate.edge()); };
  split.rank_by(
      [&](auto& trial, auto& scratch) { return queries.predict_split(trial.edge(), scratch, &trial.surface_read); });
  split.propose = [&](const Candidate& candidate, auto&) { return Proposal<Dim>{make_split(mesh, candidate.edge())}; };
  split.after = [&](const Trial<Dim>& trial, bool is_applied) {
    if (is_applied) return inherit(session, trial);
    double& best = session.report().best_refused_gain;
    best = std::max(best, trial.was_previewed ? trial.verdict.gain - noise_in(trial, scaling) : trial.gain);
  };

  Operation<Dim> curve(session, OperationKind::curve, &RemeshReport::curves, options.curve_tolerance());
  curve.refuse = [&](const Candidate& candidate) {
    return may_refine(session, candidate.edge()) ? queries.refuse_curve(candidate.edge()) : Refusal::not_asked;
  };
  curve.rank_by(
      [&](auto& trial, auto& scratch) { return queries.predict_curve(trial.edge(), scratch, &trial.surface_read); });
  curve.propose = [&](const Candidate& candidate, auto& scratch) {
    if (queries.may_touch(candidate.edge(), scratch)) return refused<Dim>(Refusal::overhang);
    return Proposal<Dim>{make_curve(mesh, candidate.edge())};
  };

  for (Operation<Dim>* operation : {&split, &curve}) {
    operation->patch_over_prediction = [&](const auto& trial) { return queries.patch_over_refinement(trial); };
    operation->remember = [=](const auto& trial) { return remember_refinement(trial, scaling); };
  }
  run_operations<Dim>(session, {options.split.enabled ? &split : nullptr, options.curve.enabled ? &curve : nullptr});
  session.memory().forget_depths();
}

template void refine_edges(RemeshSession<2>&);
template void refine_edges(RemeshSession<3>&);

}  // namespace itr
