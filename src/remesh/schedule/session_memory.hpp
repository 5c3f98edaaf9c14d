// SPDX-License-Identifier: MIT
// Memory of operations during one call of the remesher; refusals also from step to step.
#pragma once

#include <array>
#include <unordered_map>

#include "change_log.hpp"
#include "itr/remesh/memory.hpp"
#include "remesh/decide/queries.hpp"

namespace itr {

/// Collapses or swaps of one edge a step.
inline constexpr int kMostGenerations = 3;

/// Change of a signal by which a refusal no longer holds.
inline constexpr double kSameSignal = 1.2;

template <int Dim>
class SessionMemory {
 public:
  /// `remembers`: refusals.
  SessionMemory(const RemeshMemory& memory, bool remembers, const ChangeLog<Dim>& log);
  /// Forgets refusals of the edges of new cells.
  void follow(const Mesh<Dim>& mesh, const Change<Dim>& change);
  /// Refusals of edges that are still there.
  RemeshMemory::Refusals remembered(const RemeshQueries<Dim>& ask) const;

  /// Whether the same edit was refused before and its signal is still in the refusal's range.
  bool was_refused(RemeshMemory::Kind kind, const Place& place, double signal, bool in_contact) const {
    if (!remembers_) return false;
    const auto it = refused_[kind].find(place);
    return it != refused_[kind].end() && it->second.holds(signal, in_contact);
  }
  void remember(RemeshMemory::Kind kind, const Place& place, const RemeshMemory::SignalRange& range) {
    if (remembers_) refused_[kind][place] = range;
  }

  /// Generations of an edge in this pass.
  int depth(const EdgeKey& edge) const {
    const auto it = depth_.find(edge);
    return it == depth_.end() ? 0 : it->second;
  }
  void set_depth(const EdgeKey& edge, int generation) { depth_[edge] = generation; }
  void forget_depths() { depth_.clear(); }

  /// Marks the places of all commits so far as gains: cells there may be badly shaped.
  void mark_gains() { gains_until_ = log_.now(); }
  bool was_gain(const Place& place) const { return log_.had_changed_around(place, gains_until_); }

 private:
  const ChangeLog<Dim>& log_;
  bool remembers_;
  std::array<std::unordered_map<Place, RemeshMemory::SignalRange, Place::Hash>, RemeshMemory::kKinds> refused_;
  std::unordered_map<EdgeKey, int, EdgeKeyHash> depth_;
  unsigned gains_until_ = 0;
};

}  // namespace itr
