// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <set>
#include <unordered_map>
#include <utility>

#include "itr/core/types.hpp"

namespace itr {

struct EdgeKeyHash {
  std::size_t operator()(const EdgeKey& e) const {
    return static_cast<std::size_t>(e[0]) * 0x9E3779B97F4A7C15ull ^ (static_cast<std::size_t>(e[1]) * 0xC2B2AE3D27D4EB4Full);
  }
};

/// Edges (a vertex v is {v, kNone}) in order of descending priority, ties by key; each is there once.
class EdgeQueue {
 public:
  void push(const EdgeKey& edge, double priority) {
    if (const auto it = priority_.find(edge); it != priority_.end()) entries_.erase({-it->second, edge});
    priority_[edge] = priority;
    entries_.insert({-priority, edge});
  }
  std::optional<EdgeKey> pop() {
    if (entries_.empty()) return std::nullopt;
    const EdgeKey edge = entries_.begin()->second;
    entries_.erase(entries_.begin());
    priority_.erase(edge);
    return edge;
  }

 private:
  std::set<std::pair<double, EdgeKey>> entries_;
  std::unordered_map<EdgeKey, double, EdgeKeyHash> priority_;
};

}  // namespace itr
