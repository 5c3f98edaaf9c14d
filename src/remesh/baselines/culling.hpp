// SPDX-License-Identifier: MIT
// The paper's culling: edges are ranked once a step by the energy around them, on the solution before remeshing.
#pragma once

#include <unordered_map>

#include "remesh/decide/queries.hpp"

namespace itr {

template <int Dim>
class Culling {
 public:
  /// Ranks the edges of the mesh as it is (REMESHING.md, "The rules"): elastic energy of an edge = mean over incident cells,
  /// contact energy = mean over its ends; top if either is among the tops, bottom only if both are at the bottom. Leaves out
  /// no edge with another screening than `energy_percentile`.
  void rank(const RemeshQueries<Dim>& ask);
  bool may_split(const EdgeKey& edge) const { return !is_on_ || rank_of(edge) == Rank::top; }
  bool may_collapse(const EdgeKey& edge) const { return !is_on_ || rank_of(edge) == Rank::bottom; }
  /// A part of a split edge gets its rank.
  void inherit(const EdgeKey& split, const EdgeKey& part) {
    if (is_on_) ranks_[part] = rank_of(split);
  }

 private:
  enum class Rank : char { bottom, middle, top };
  class Thresholds;
  Rank rank_of(const EdgeKey& edge) const {
    const auto it = ranks_.find(edge);
    return it == ranks_.end() ? Rank::middle : it->second;
  }
  bool is_on_ = false;
  std::unordered_map<EdgeKey, Rank, EdgeKeyHash> ranks_;
};

}  // namespace itr
