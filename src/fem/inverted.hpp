// SPDX-License-Identifier: MIT
#pragma once

#include "fem/cell_set.hpp"
#include "geometry/quadratic_validity.hpp"
#include "mesh/validate.hpp"

namespace itr {

/// The first cell that is not positively oriented everywhere, decided exactly; kNone: none.
template <int Dim>
CellId find_inverted(const Mesh<Dim>& mesh, ConstVectorView x) {
  for (const CellId c : mesh.live_cells()) {
    const auto element = element_of(mesh, c);
    const bool is_positive = element.curved ? is_positive_everywhere_exact<Dim>(at_all_nodes<Dim>(element, x))
                                            : is_positively_oriented<Dim>(element.vertices, x);
    if (!is_positive) return c;
  }
  return kNone;
}

}  // namespace itr
