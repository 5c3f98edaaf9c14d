// SPDX-License-Identifier: MIT
#pragma once

#include "itr/fem/cell_set.hpp"
#include "itr/geometry/quadratic_validity.hpp"
#include "mesh/validate.hpp"

namespace itr {

/// The first cell that is not positively oriented everywhere, decided exactly; kNone: none. `node_of(a, b)`: the node of an
/// edge or kNone.
template <int Dim, typename NodeOf>
CellId find_inverted(const Mesh<Dim>& mesh, ConstVectorView x, const NodeOf& node_of) {
  for (CellId c = 0; c < mesh.cell_slots(); ++c) {
    if (!mesh.is_cell_alive(c)) continue;
    typename CellSet<Dim>::CurvedElement element{};
    element.curved = find_nodes<Dim>(mesh.cell(c), node_of, element.nodes);
    const bool is_positive = element.curved ? is_positive_everywhere_exact<Dim>(at_all_nodes<Dim>(element, x))
                                            : is_positively_oriented<Dim>(mesh.cell(c), x);
    if (!is_positive) return c;
  }
  return kNone;
}

}  // namespace itr
