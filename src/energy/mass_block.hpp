// SPDX-License-Identifier: MIT
#pragma once

#include "fem/mass.hpp"

namespace itr {

/// The mass matrix of an element of unit mass, over all components of its vertices.
template <int Dim>
Mat<Dim*(Dim + 1)> unit_mass_block(MassKind kind) {
  const ElementMass<Dim> unit(kind, 1);
  Mat<Dim*(Dim + 1)> block = Mat<Dim*(Dim + 1)>::Zero();
  for (int i = 0; i <= Dim; ++i)
    for (int j = 0; j <= Dim; ++j)
      for (int c = 0; c < Dim; ++c) block(Dim * i + c, Dim * j + c) = unit.off + (i == j ? unit.extra : 0);
  return block;
}

}  // namespace itr
