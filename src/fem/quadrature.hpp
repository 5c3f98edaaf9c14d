// SPDX-License-Identifier: MIT
// Quadrature on simplices: points in barycentric coordinates, positive weights of sum 1.
#pragma once

#include <algorithm>
#include <array>
#include <vector>

#include "itr/options.hpp"

namespace itr {

template <int Dim>
struct QuadraturePoint {
  std::array<double, Dim + 1> weights;  ///< barycentric coordinates
  double fraction;                      ///< of the simplex' measure
};

/// A rule that is exact for polynomials of `degree` (1 to 5) on a simplex of dimension 1, 2 or 3. Throws InputError for
/// others.
template <int Dim>
const std::vector<QuadraturePoint<Dim>>& quadrature(int degree);

/// A rule of degree 3 with points at the corners and (2D) on the edges or (3D) on the faces, on each of the 2^(Dim (level -
/// 1)) simplices of equal measure that `level` - 1 uniform refinements give. Level 1 to kMostClosedLevel, dimension 2 or 3.
template <int Dim>
const std::vector<QuadraturePoint<Dim>>& closed_quadrature(int level);
inline constexpr int kMostClosedLevel = 3;

/// The rule of a curved cell: that of closed_quadrature, or, at level 0, that of `degree`.
template <int Dim>
const std::vector<QuadraturePoint<Dim>>& cell_quadrature(int level, int degree) {
  return level == 0 ? quadrature<Dim>(degree) : closed_quadrature<Dim>(level);
}

inline constexpr int kMassDegree = 4;  ///< products of two quadratic functions

/// The degree of a rule of `degree` for integrands times the radius, where cells are turned about an axis.
inline int degree_with_turn(int degree, bool is_turned) {
  return is_turned ? std::min(degree + 1, kMostQuadratureDegree) : degree;
}

}  // namespace itr
