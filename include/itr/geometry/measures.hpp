// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/LU>
#include <array>

#include "itr/core/types.hpp"

namespace itr {

/// Matrix whose columns are the edges p_1 - p_0, ..., p_Dim - p_0 of a simplex.
template <int Dim>
Mat<Dim> edge_matrix(const std::array<Vec<Dim>, Dim + 1>& p) {
  Mat<Dim> edges;
  for (int k = 0; k < Dim; ++k) edges.col(k) = p[k + 1] - p[0];
  return edges;
}

/// Signed area (2D) or volume (3D) of a simplex, from the determinant of its edge matrix.
template <int Dim>
double simplex_volume(const Mat<Dim>& edges) {
  return edges.determinant() / (Dim == 2 ? 2 : 6);
}
template <int Dim>
double simplex_volume(const std::array<Vec<Dim>, Dim + 1>& p) {
  return simplex_volume<Dim>(edge_matrix<Dim>(p));
}

}  // namespace itr
