// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <array>
#include <cmath>

#include "itr/types.hpp"

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

/// A normal of a facet, of any length, into its body.
inline Vec<2> inward_normal(const std::array<Vec<2>, 2>& p) { return {p[0][1] - p[1][1], p[1][0] - p[0][0]}; }
inline Vec<3> inward_normal(const std::array<Vec<3>, 3>& p) { return (p[2] - p[0]).cross(p[1] - p[0]); }

/// 1 for a regular simplex, 0 for a flat one, negative for an inverted one: its volume by that of the regular one of the
/// same root mean square edge. (Parthasarathy, Graichen & Hathaway 1994 compare such measures.)
template <int Dim>
double simplex_quality(const std::array<Vec<Dim>, Dim + 1>& p) {
  double squared = 0;
  for (int i = 0; i <= Dim; ++i)
    for (int j = 0; j < i; ++j) squared += (p[i] - p[j]).squaredNorm();
  constexpr double kEdges = 0.5 * Dim * (Dim + 1);
  const double edge = std::sqrt(squared / kEdges);
  const double regular = Dim == 2 ? std::sqrt(3.0) / 4 : std::sqrt(2.0) / 12;
  return simplex_volume<Dim>(p) / (regular * (Dim == 2 ? edge * edge : edge * edge * edge));
}

}  // namespace itr
