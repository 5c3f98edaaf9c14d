// SPDX-License-Identifier: MIT
#include "session_memory.hpp"

#include <algorithm>

namespace itr {

template <int Dim>
SessionMemory<Dim>::SessionMemory(const RemeshMemory& memory, bool remembers, const ChangeLog<Dim>& log)
    : log_(log), remembers_(remembers) {
  refused_.reserve(2 * memory.refusals.size());
  for (const auto& [candidate, range] : memory.refusals) refused_.emplace(candidate, range);
}

template <int Dim>
void SessionMemory<Dim>::follow(const Mesh<Dim>& mesh, const Change<Dim>& change) {
  for (const EdgeKey& edge : edges_of<Dim>(mesh, change.cells))
    for (int kind = 0; kind < kOperationKinds; ++kind) refused_.erase(Candidate(static_cast<OperationKind>(kind), edge));
  if constexpr (Dim == 3)
    for (const CellId c : change.cells)
      for (int k = 0; k <= Dim; ++k)
        refused_.erase(Candidate(OperationKind::remove_facet, opposite_facet<3>(mesh.cell(c), k)));
}

template <int Dim>
std::vector<RemeshMemory::Entry> SessionMemory<Dim>::remembered(const RemeshQueries<Dim>& queries) const {
  std::vector<RemeshMemory::Entry> refusals;
  for (const auto& [candidate, range] : refused_)
    if (queries.exists(candidate)) refusals.push_back({candidate, range});
  std::ranges::sort(refusals, {}, &RemeshMemory::Entry::candidate);
  return refusals;
}

template class SessionMemory<2>;
template class SessionMemory<3>;

}  // namespace itr
