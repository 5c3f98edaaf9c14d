// SPDX-License-Identifier: MIT
#include "itr/remesh/memory.hpp"

#include <algorithm>

namespace itr {

void RemeshMemory::renumber(std::span<const VertexId> number) {
  for (auto& list : refusals) {
    const auto renumbered = [&](Entry& entry) {
      auto& [a, b] = entry.edge;
      a = number[a];
      if (b == kNone) return a != kNone;
      b = number[b];
      if (a > b) std::swap(a, b);
      return a != kNone;  // the smaller of the two
    };
    std::size_t kept = 0;
    for (Entry& entry : list)
      if (renumbered(entry)) list[kept++] = entry;
    list.resize(kept);
    std::sort(list.begin(), list.end(), [](const Entry& x, const Entry& y) { return x.edge < y.edge; });
  }
}

}  // namespace itr
