// SPDX-License-Identifier: MIT
#include "refusals.hpp"

#include <algorithm>

namespace itr {

Refusals::Refusals(const RemeshMemory& memory) {
  for (int kind = 0; kind < RemeshMemory::kKinds; ++kind) {
    by_edge_[kind].reserve(2 * memory.refusals[kind].size());
    for (const auto& [edge, refusal] : memory.refusals[kind]) by_edge_[kind][edge] = refusal;
  }
}

template <int Dim>
RemeshMemory Refusals::remembered(const Mesh<Dim>& mesh) const {
  RemeshMemory memory;
  const auto is_there = [&](const EdgeKey& edge) {
    return mesh.is_vertex_alive(edge[0]) && (edge[1] == kNone || mesh.are_joined(edge[0], edge[1]));
  };
  for (int kind = 0; kind < RemeshMemory::kKinds; ++kind) {
    auto& list = memory.refusals[kind];
    for (const auto& [edge, refusal] : by_edge_[kind])
      if (is_there(edge)) list.push_back({edge, refusal});
    std::sort(list.begin(), list.end(), [](const auto& x, const auto& y) { return x.edge < y.edge; });
  }
  return memory;
}

template RemeshMemory Refusals::remembered(const Mesh<2>&) const;
template RemeshMemory Refusals::remembered(const Mesh<3>&) const;

}  // namespace itr
