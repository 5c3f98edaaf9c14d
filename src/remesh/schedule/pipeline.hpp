// SPDX-License-Identifier: MIT
// One pipeline for all operations. It asks the questions of an Operation about each candidate, always in one order:
//
// 1. refuse: do lengths, depths and tags around the candidate forbid it?
// 2. key: does the memory hold a refusal with this refusal key?
// 3. predict: what do the terms of the bulk promise, of the proposed edit in most operations?
// 4. tolerance, patch_over_prediction: may a patch gain enough, if so many times the prediction is all that it gains?
// 5. propose: which edit is it?
//
// A preview decides (trial.hpp). What it accepts is applied, and other refusals are remembered. Candidates come from a queue
// in batches. All threads evaluate a batch on the mesh as it is; then one of them applies the results in the queue's order.
// A candidate goes back to the queue if an earlier one of its batch has changed something that its evaluation read. The size
// of a batch depends on the results of the one before and never on threads, so neither do results.
#pragma once

#include <functional>
#include <initializer_list>
#include <optional>
#include <vector>

#include "session.hpp"

namespace itr {

/// Differences between operations. Several threads ask them at the same time, but for `list`, `after` and `edges_to_ask`.
template <int Dim>
struct Operation {
  using Scratch = LocalScratch<Dim>;

  /// Only `propose` has no default. `least_gain`: tolerance [J].
  Operation(RemeshSession<Dim>& session, OperationKind kind, OperationCount RemeshReport::*count, double least_gain);
  Operation(const Operation&) = delete;
  Operation& operator=(const Operation&) = delete;
  /// Ranks candidates by a prediction that needs no edit, and takes it for the refusal key.
  void rank_by(std::function<double(Trial<Dim>&, Scratch&)> gain);

  OperationKind kind;
  OperationCount RemeshReport::*count;
  LocalRelaxationOptions local;

  /// Candidates of the whole mesh: one at each edge.
  std::function<std::vector<Candidate>()> list;
  /// Whether an edge that is new, or whose cells have changed, is a candidate: each is.
  std::function<bool(const EdgeKey&)> is_candidate;
  /// Reason why a candidate is out of the question; `not_asked` is not counted. None.
  std::function<Refusal(const Candidate&)> refuse;
  /// Priority of a candidate; none: it is not asked. Without this function it is the predicted gain for each node.
  std::function<std::optional<double>(const Candidate&)> priority;
  /// Nodes that the operation adds or removes: 1.
  std::function<int(const Candidate&)> num_nodes;
  /// Number that a refusal depends on: the roughness.
  std::function<double(Trial<Dim>&, Scratch&)> key;
  /// Gain that is predicted for the proposed edit [J, times the scaling]; none where there is no edit, and the trial has the
  /// reason.
  std::function<std::optional<double>(Trial<Dim>&, Scratch&)> predict;
  /// Least gain of a trial [J]: that of the operation.
  std::function<double(const Trial<Dim>&)> tolerance;
  /// How many times its prediction a patch may gain: `patch_over_vertex`. None: only a trial can tell, as in contact.
  std::function<std::optional<double>(const Trial<Dim>&)> patch_over_prediction;
  std::function<Proposal<Dim>(const Candidate&, Scratch&)> propose;
  /// Refusal keys for which the refusal of a trial holds: up to kSameKey.
  std::function<RemeshMemory::KeyRange(const Trial<Dim>&)> remember;
  /// Called with each trial and whether it was applied.
  std::function<void(const Trial<Dim>&, bool)> after;
  /// Edges that are asked (again) after a trial was applied: those of new cells.
  std::function<std::vector<EdgeKey>(const Trial<Dim>&)> edges_to_ask;
};

/// Decides about all candidates of these operations, which have one queue and are of different kinds; null: none.
template <int Dim>
void run_operations(RemeshSession<Dim>& session, std::initializer_list<Operation<Dim>*> operations);

}  // namespace itr
