// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Geometry>

#include "itr/mesh.hpp"

namespace itr {

/// Length or area of a boundary facet at rest [m], [m^2].
template <int Dim>
double facet_measure(const Mesh<Dim>& mesh, FacetId f) {
  const auto& facet = mesh.facet(f);
  const Vec<Dim> a = mesh.rest(facet[1]) - mesh.rest(facet[0]);
  if constexpr (Dim == 2) {
    return a.norm();
  } else {
    return a.cross(Vec<Dim>(mesh.rest(facet[2]) - mesh.rest(facet[0]))).norm() / 2;
  }
}

}  // namespace itr
