// SPDX-License-Identifier: MIT
// Cells as an edit would make them, or as they are, for a CellModel.
#pragma once

#include "energy/cell_model.hpp"
#include "remesh/curved_cell.hpp"
#include "remesh/edits.hpp"

namespace itr {

/// Leaves everything as it is.
template <int Dim>
const Edit<Dim>& no_edit() {
  static const Edit<Dim> none{.kind = Edit<Dim>::Kind::split};
  return none;
}

/// A cell after an edit at present positions. Without inertia `step` is 0.
template <int Dim>
PlacedCell<Dim> place(const Mesh<Dim>& mesh, const RemeshFields<Dim>& fields, const PotentialTerms<Dim>& terms,
                      const CurvedCell<Dim>& cell, const Edit<Dim>& edit) {
  PlacedCell<Dim> placed;
  placed.curved = cell.edges;
  if (!terms.has_inertia) placed.step.setZero();
  const auto fill = [&](const auto& value_of, const auto& rest_of) {
    for (int k = 0; k < (cell.edges ? kQuadraticNodes<Dim> : Dim + 1); ++k) {
      if (!has_node<Dim>(cell.edges, k)) continue;
      const VertexId v = cell.nodes[k];
      if (k <= Dim) placed.rest[k] = rest_of(v);
      placed.x.col(k) = value_of(fields.x, v);
      if (terms.has_inertia) placed.step.col(k) = placed.x.col(k) - value_of(fields.predictor, v);
    }
  };
  if (&edit == &no_edit<Dim>())
    fill([](const VectorX& field, VertexId v) -> Vec<Dim> { return field.segment<Dim>(Dim * v); },
         [&](VertexId v) -> const Vec<Dim>& { return mesh.rest(v); });
  else
    fill([&](const VectorX& field, VertexId v) { return RemeshFields<Dim>::after(field, edit, v); },
         [&](VertexId v) { return rest_after(mesh, edit, v); });
  return placed;
}

}  // namespace itr
