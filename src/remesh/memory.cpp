// SPDX-License-Identifier: MIT
#include "itr/remesh/memory.hpp"

#include <algorithm>

namespace itr {

void RemeshMemory::begin(const std::array<double, kKinds>& present) {
  constexpr double kClearly = 1.2;
  for (int kind = 0; kind < kKinds; ++kind) {
    const double now = present[kind];  // the least gain: negative where an operation may cost energy
    std::optional<double>& before = tolerances[kind];
    const bool accepts_more = before && (now > 0 ? kClearly * now < *before : now < kClearly * *before);
    if (accepts_more) refusals[kind].clear();
    before = before && !accepts_more ? std::max(*before, now) : now;
  }
}

void RemeshMemory::renumber(std::span<const VertexId> number) {
  for (auto& list : refusals) {
    const auto renumbered = [&](Entry& entry) {
      for (const VertexId v : entry.place.vertices())
        if (number[v] == kNone) return false;
      if (entry.place.is_vertex())
        entry.place = Place::at_vertex(number[entry.place.vertex()]);
      else
        entry.place = EdgeKey{number[entry.place.edge()[0]], number[entry.place.edge()[1]]};
      return true;
    };
    std::size_t kept = 0;
    for (Entry& entry : list)
      if (renumbered(entry)) list[kept++] = entry;
    list.resize(kept);
    std::sort(list.begin(), list.end(), [](const Entry& x, const Entry& y) { return x.place < y.place; });
  }
}

}  // namespace itr
