// SPDX-License-Identifier: MIT
// Memory of operations during one call of the remesher; refusals also from step to step.
#pragma once

#include <unordered_map>
#include <vector>

#include "change_log.hpp"
#include "remesh/decide/queries.hpp"
#include "remesh/memory.hpp"

namespace itr {

/// Collapses or swaps of one edge a step.
inline constexpr int kMostGenerations = 3;

/// Change of a refusal key by which a refusal no longer holds.
inline constexpr double kSameKey = 1.2;

template <int Dim>
class SessionMemory {
 public:
  /// `remembers`: refusals.
  SessionMemory(const RemeshMemory& memory, bool remembers, const ChangeLog<Dim>& log);
  /// Forgets refusals at the edges and facets of new cells.
  void follow(const Mesh<Dim>& mesh, const Change<Dim>& change);
  /// Refusals of candidates that are still there.
  std::vector<RemeshMemory::Entry> remembered(const RemeshQueries<Dim>& queries) const;

  /// Whether the candidate was refused before and its refusal key is still in the refusal's range.
  bool was_refused(const Candidate& candidate, double key, bool in_contact) const {
    if (!remembers_) return false;
    const auto it = refused_.find(candidate);
    return it != refused_.end() && it->second.holds(key, in_contact);
  }
  void remember(const Candidate& candidate, const RemeshMemory::KeyRange& range) {
    if (remembers_) refused_[candidate] = range;
  }

  /// Generations of an edge in this pass.
  int depth(const EdgeKey& edge) const {
    const auto it = depth_.find(edge);
    return it == depth_.end() ? 0 : it->second;
  }
  void set_depth(const EdgeKey& edge, int generation) { depth_[edge] = generation; }
  void forget_depths() { depth_.clear(); }

  /// Marks the surroundings of all commits so far as gains: cells there may be badly shaped.
  void mark_gains() { gains_until_ = log_.now(); }
  bool was_gain(const Candidate& candidate) const { return log_.had_changed_around(candidate, gains_until_); }

 private:
  const ChangeLog<Dim>& log_;
  bool remembers_;
  std::unordered_map<Candidate, RemeshMemory::KeyRange, Candidate::Hash> refused_;
  std::unordered_map<EdgeKey, int, EdgeKeyHash> depth_;
  unsigned gains_until_ = 0;
};

}  // namespace itr
