// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <unordered_map>

#include "itr/mesh/mesh.hpp"
#include "itr/remesh/memory.hpp"
#include "queue.hpp"

namespace itr {

/// RemeshMemory while a mesh is changed: found by edge.
class Refusals {
 public:
  explicit Refusals(const RemeshMemory& memory);
  /// Those of edges that are still there.
  template <int Dim>
  RemeshMemory remembered(const Mesh<Dim>& mesh) const;

  bool holds(RemeshMemory::Kind kind, const EdgeKey& edge, double signal, bool in_contact) const {
    const auto it = by_edge_[kind].find(edge);
    return it != by_edge_[kind].end() && it->second.holds(signal, in_contact);
  }
  void add(RemeshMemory::Kind kind, const EdgeKey& edge, const RemeshMemory::Refusal& refusal) {
    by_edge_[kind][edge] = refusal;
  }
  void forget(const EdgeKey& edge) {
    for (auto& map : by_edge_) map.erase(edge);
  }

 private:
  std::array<std::unordered_map<EdgeKey, RemeshMemory::Refusal, EdgeKeyHash>, RemeshMemory::kKinds> by_edge_;
};

}  // namespace itr
