// SPDX-License-Identifier: MIT
// Straightenings, which cost least first, then collapses, shortest first. Whether edges are curved does not change the order
// of collapses.
#include <algorithm>
#include <cmath>
#include <limits>

#include "remesh/edits.hpp"
#include "remesh/schedule/pipeline.hpp"

namespace itr {

namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();

/// A rougher field or a rounder edge loses more.
template <int Dim>
RemeshMemory::KeyRange remember_coarsening(const Trial<Dim>& trial) {
  return {trial.key / kSameKey, trial.in_contact ? trial.key * kSameKey : kNever, trial.in_contact};
}

template <int Dim>
void straighten_edges(RemeshSession<Dim>& session) {
  const RemeshQueries<Dim>& queries = session.queries();
  const Mesh<Dim>& mesh = queries.mesh();
  const double least = queries.options().straighten_tolerance();
  Operation<Dim> straighten(session, OperationKind::straighten, &RemeshReport::straightens, least);
  straighten.is_candidate = [&](const EdgeKey& edge) { return mesh.node_of(edge[0], edge[1]) != kNone; };
  straighten.refuse = [&](const Candidate& candidate) {
    return straighten.is_candidate(candidate.edge()) ? Refusal::none : Refusal::not_asked;
  };
  straighten.rank_by(
      [&](auto& trial, auto& scratch) { return queries.predict_straighten(trial.edge(), scratch, &trial.surface_read); });
  // Where the edge had better go, no refusal holds: the key is infinite.
  straighten.key = [&, gain = straighten.key](auto& trial, auto& scratch) {
    const double cost = std::abs(gain(trial, scratch));
    const bool had_better_go =
        queries.overhangs(trial.edge(), scratch) || queries.is_distorted(mesh.cells_of_edge(trial.edge()));
    return had_better_go ? kNever : cost;
  };
  straighten.tolerance = [&, least](const auto& trial) {
    return trial.key < kNever ? least : std::min(least, -queries.options().split.acceptance_tolerance.value());
  };
  straighten.patch_over_prediction = [factor = straighten.patch_over_prediction](const auto& trial) {
    return trial.key < kNever ? factor(trial) : std::nullopt;
  };
  straighten.propose = [&](const Candidate& candidate, auto&) {
    return Proposal<Dim>{make_straighten(mesh, candidate.edge())};
  };
  straighten.remember = remember_coarsening<Dim>;
  run_operations<Dim>(session, {&straighten});
}

template <int Dim>
void collapse_edges(RemeshSession<Dim>& session) {
  const RemeshQueries<Dim>& queries = session.queries();
  const Mesh<Dim>& mesh = queries.mesh();
  const CollapseOptions& options = queries.options().collapse;
  const double least = options.acceptance_tolerance.value();
  Operation<Dim> collapse(session, OperationKind::collapse, &RemeshReport::collapses, least);
  collapse.refuse = [&](const Candidate& candidate) {
    const EdgeKey edge = candidate.edge();
    if (session.baseline() && !session.baseline()->may_collapse(edge)) return Refusal::not_asked;
    if (const Refusal refusal = queries.refuse_collapse(edge); refusal != Refusal::none) return refusal;
    return session.memory().depth(edge) >= options.max_depth ? Refusal::depth : Refusal::none;
  };
  collapse.priority = [&](const Candidate& candidate) { return -queries.rest_length(candidate.edge()); };
  collapse.predict = [&, least](auto& trial, auto& scratch) -> std::optional<double> {
    if (!trial.take(collapse.propose(trial.candidate(), scratch))) return std::nullopt;
    return queries.predict_collapse(*trial.edit, least, scratch, &trial.surface_read);
  };
  collapse.propose = [&](const Candidate& candidate, auto&) {
    return propose_collapse(mesh, queries.strata(), candidate.edge());
  };
  collapse.remember = remember_coarsening<Dim>;
  collapse.edges_to_ask = [&](const auto& trial) { return edges_of<Dim>(mesh, mesh.cells_of(trial.edit->value->vertex)); };
  collapse.after = [&](const auto& trial, bool is_applied) {
    if (!is_applied) return;
    const VertexId kept = trial.edit->value->vertex;
    const int generation = session.memory().depth(trial.edge()) + 1;
    for (const EdgeKey& edge : collapse.edges_to_ask(trial))
      if (edge[0] == kept || edge[1] == kept) session.memory().set_depth(edge, generation);
  };
  run_operations<Dim>(session, {&collapse});
  session.memory().forget_depths();
}

}  // namespace

template <int Dim>
void coarsen_edges(RemeshSession<Dim>& session) {
  const RemeshOptions& options = session.queries().options();
  if (options.straighten.enabled && session.queries().mesh().has_nodes()) straighten_edges(session);
  if (options.collapse.enabled) collapse_edges(session);
}

template void coarsen_edges(RemeshSession<2>&);
template void coarsen_edges(RemeshSession<3>&);

}  // namespace itr
