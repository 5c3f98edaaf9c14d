// SPDX-License-Identifier: MIT
#include "remesh/memory.hpp"

#include <algorithm>

namespace itr {

void RemeshMemory::begin(const std::array<double, kOperationKinds>& present) {
  constexpr double kClearly = 1.2;
  for (int kind = 0; kind < kOperationKinds; ++kind) {
    const double now = present[kind];  // the least gain: negative where an operation may cost energy
    std::optional<double>& before = tolerances[kind];
    const bool accepts_more = before && (now > 0 ? kClearly * now < *before : now < kClearly * *before);
    if (accepts_more)
      std::erase_if(refusals, [&](const Entry& entry) { return static_cast<int>(entry.candidate.kind()) == kind; });
    before = before && !accepts_more ? std::max(*before, now) : now;
  }
}

void RemeshMemory::renumber(std::span<const VertexId> number) {
  std::erase_if(refusals, [&](const Entry& entry) {
    return std::ranges::any_of(entry.candidate.vertices(), [&](VertexId v) { return number[v] == kNone; });
  });
  for (Entry& entry : refusals) entry.candidate = entry.candidate.renumbered(number);
  std::ranges::sort(refusals, {}, &Entry::candidate);
}

}  // namespace itr
