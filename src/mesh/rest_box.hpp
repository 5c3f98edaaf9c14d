// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Geometry>

#include "itr/mesh.hpp"

namespace itr {

/// Holds all vertices at rest [m].
template <int Dim>
Eigen::AlignedBox<double, Dim> rest_box(const Mesh<Dim>& mesh) {
  Eigen::AlignedBox<double, Dim> box;
  for (const VertexId v : mesh.live_vertices()) box.extend(mesh.rest(v));
  return box;
}

}  // namespace itr
