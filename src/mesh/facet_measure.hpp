// SPDX-License-Identifier: MIT
#pragma once

#include <array>

#include "geometry/facet_area.hpp"
#include "itr/mesh.hpp"

namespace itr {

/// Length or area of a boundary facet at rest [m], [m^2].
template <int Dim>
double facet_measure(const Mesh<Dim>& mesh, FacetId f) {
  std::array<Vec<Dim>, Dim> corners;
  for (int k = 0; k < Dim; ++k) corners[k] = mesh.rest(mesh.facet(f)[k]);
  return facet_area(corners);
}

}  // namespace itr
