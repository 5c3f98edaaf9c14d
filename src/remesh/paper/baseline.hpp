// SPDX-License-Identifier: MIT
// The paper's rules in place of ours (docs/theory.md): culling, sizing field. A session has a Baseline only if its options
// choose one of them.
#pragma once

#include <memory>
#include <unordered_map>

#include "itr/mesh.hpp"
#include "itr/options.hpp"

namespace itr {

template <int Dim>
class RemeshQueries;

template <int Dim>
class Baseline {
 public:
  /// Null if the options choose none of these rules.
  static std::unique_ptr<Baseline> chosen_by(const RemeshOptions& options);
  explicit Baseline(const RemeshOptions& options) : options_(options) {}

  /// Whether lengths of edges decide about splits and collapses, instead of energies: then follow_sizing_field makes them.
  bool decides_by_size() const { return options_.sizing_field.enabled; }
  /// Whether bounds decide where they can, and refusals are remembered.
  bool has_bounds() const { return options_.screening == Screening::bounds; }

  /// Culling: ranks the edges of the mesh as it is (docs/theory.md, "The rules"): elastic energy of an edge = mean over
  /// incident cells, contact energy = mean over its ends; top if either is among the tops, bottom only if both are at the
  /// bottom. Leaves out no edge with another screening than `energy_percentile`.
  void rank(const RemeshQueries<Dim>& queries);
  bool may_split(const EdgeKey& edge) const { return !culls() || rank_of(edge) == Rank::top; }
  bool may_collapse(const EdgeKey& edge) const { return !culls() || rank_of(edge) == Rank::bottom; }
  /// A part of a split edge gets its rank.
  void inherit(const EdgeKey& split, const EdgeKey& part) {
    if (culls()) ranks_[part] = rank_of(split);
  }

 private:
  enum class Rank : char { bottom, middle, top };
  class Thresholds;
  bool culls() const { return options_.screening == Screening::energy_percentile; }
  Rank rank_of(const EdgeKey& edge) const {
    const auto it = ranks_.find(edge);
    return it == ranks_.end() ? Rank::middle : it->second;
  }
  const RemeshOptions& options_;
  std::unordered_map<EdgeKey, Rank, EdgeKeyHash> ranks_;
};

}  // namespace itr
