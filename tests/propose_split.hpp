// SPDX-License-Identifier: MIT
// Splits for tests that make thousands of edits in a row: where they do not make needles.
#pragma once

#include "remesh/edits/edit_checks.hpp"

namespace itr {

inline constexpr QualityRule kSplitRule{.fraction = 0, .floor = 1e-4};

/// Splits an edge if it is there and the new cells keep the rule.
template <int Dim>
Proposal<Dim> propose_split(const Mesh<Dim>& mesh, const EdgeKey& edge) {
  const auto cells = mesh.cells_of_edge(edge);
  if (cells.empty()) return refused<Dim>(Refusal::gone);
  const double least = kSplitRule.least(worst_quality<Dim>(mesh, cells));
  const Vec<Dim> middle = 0.5 * (mesh.rest(edge[0]) + mesh.rest(edge[1]));
  for (const CellId c : cells)
    for (const int end : edge) {
      const double quality = quality_with<Dim>(mesh, mesh.cell(c), end, middle);
      if (!(quality > 0 && quality >= least)) return refused<Dim>(Refusal::shape);
    }
  return {.edit = make_split(mesh, edge)};
}

}  // namespace itr
