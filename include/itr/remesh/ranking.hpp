// SPDX-License-Identifier: MIT
// The paper's culling: edges are ranked once a step by the energy around them, on the solution before remeshing.
#pragma once

#include <unordered_map>

#include "itr/remesh/fields.hpp"

namespace itr {

struct EdgeKeyHash {
  std::size_t operator()(const EdgeKey& e) const {
    return static_cast<std::size_t>(e[0]) * 0x9E3779B97F4A7C15ull ^ (static_cast<std::size_t>(e[1]) * 0xC2B2AE3D27D4EB4Full);
  }
};

enum class Rank : char { bottom, middle, top };
using EdgeRanks = std::unordered_map<EdgeKey, Rank, EdgeKeyHash>;

/// scene-format §8.2: elastic energy of an edge = mean over incident cells, contact energy = mean over its ends; top if
/// either is among the tops, bottom only if both are at the bottom.
EdgeRanks rank_edges(const Mesh<2>& mesh, const RemeshFields<2>& fields, const StepContext<2>& context,
                     const RemeshOptions& options);

}  // namespace itr
