// SPDX-License-Identifier: MIT
#include "session_memory.hpp"

#include <algorithm>

namespace itr {

template <int Dim>
SessionMemory<Dim>::SessionMemory(const RemeshMemory& memory, bool remembers, const ChangeLog<Dim>& log)
    : log_(log), remembers_(remembers) {
  for (int kind = 0; kind < RemeshMemory::kKinds; ++kind) {
    refused_[kind].reserve(2 * memory.refusals[kind].size());
    for (const auto& [place, range] : memory.refusals[kind]) refused_[kind].emplace(place, range);
  }
}

template <int Dim>
void SessionMemory<Dim>::follow(const Mesh<Dim>& mesh, const Change<Dim>& change) {
  for (const EdgeKey& edge : edges_of<Dim>(mesh, change.cells))
    for (auto& map : refused_) map.erase(edge);
}

template <int Dim>
RemeshMemory::Refusals SessionMemory<Dim>::remembered(const RemeshQueries<Dim>& ask) const {
  RemeshMemory::Refusals refusals;
  for (int kind = 0; kind < RemeshMemory::kKinds; ++kind) {
    auto& list = refusals[kind];
    for (const auto& [place, range] : refused_[kind])
      if (ask.exists(place)) list.push_back({place, range});
    std::sort(list.begin(), list.end(), [](const auto& x, const auto& y) { return x.place < y.place; });
  }
  return refusals;
}

template class SessionMemory<2>;
template class SessionMemory<3>;

}  // namespace itr
