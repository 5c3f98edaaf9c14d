// SPDX-License-Identifier: MIT
#pragma once

#include <numbers>

#include "itr/mesh.hpp"

namespace itr {

/// Length of the circle that a rest position of an axisymmetric mesh is turned along [m]; 1 of other meshes.
template <int Dim>
double turn_at(const Mesh<Dim>& mesh, const Vec<Dim>& X) {
  return mesh.is_axisymmetric() ? 2 * std::numbers::pi * X[0] : 1;
}

}  // namespace itr
