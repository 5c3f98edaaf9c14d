// SPDX-License-Identifier: MIT
// Shapes of surfaces as entries of StepSetup::nodal_loads, as springs and coupled points are.
#pragma once

#include "energy/support.hpp"
#include "geometry/shape.hpp"

namespace itr {

/// The entry of a shape, which is no term.
template <int Dim>
struct ShapeEntry {
  std::shared_ptr<const Shape> value;
  std::shared_ptr<const Energy> operator()(const CellSet<Dim>&, double, double) const { return nullptr; }
};
template <int Dim>
std::vector<std::shared_ptr<const Shape>> shapes_of(const std::vector<TermFactory<Dim>>& loads) {
  return values_of<ShapeEntry<Dim>>(loads);
}

}  // namespace itr
