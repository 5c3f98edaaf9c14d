// SPDX-License-Identifier: MIT
// The paper's culling: edges are ranked once a step by the energy around them, on the solution before remeshing.
#pragma once

#include <unordered_map>

#include "itr/remesh/fields.hpp"
#include "queue.hpp"

namespace itr {

enum class Rank : char { bottom, middle, top };
using EdgeRanks = std::unordered_map<EdgeKey, Rank, EdgeKeyHash>;

/// REMESHING.md, "The rules": elastic energy of an edge = mean over incident cells, contact energy = mean over its ends;
/// top if either is among the tops, bottom only if both are at the bottom.
template <int Dim>
EdgeRanks rank_edges(const Mesh<Dim>& mesh, const RemeshFields<Dim>& fields, const StepContext<Dim>& context,
                     const RemeshOptions& options);

}  // namespace itr
