// SPDX-License-Identifier: MIT
// Quadrature on simplices: points in barycentric coordinates, positive weights of sum 1.
#pragma once

#include <array>
#include <vector>

#include "itr/fem/options.hpp"

namespace itr {

template <int Dim>
struct QuadraturePoint {
  std::array<double, Dim + 1> weights;  ///< barycentric coordinates
  double share;                         ///< of the simplex' measure
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

/// How finely the energy sees a curved cell: the level of its closed rule (0: the rule of the setup's degree) plus
/// kBarrierLevel times the depth of its Jacobian barrier (0: none; see JacobianBarrier).
inline constexpr int kBarrierLevel = kMostClosedLevel + 1;
inline constexpr int kMostBarrierDepth = 3;
inline constexpr int kMostCellLevel = kBarrierLevel * (kMostBarrierDepth + 1) - 1;
constexpr int closed_level(int level) { return level % kBarrierLevel; }
constexpr int barrier_depth(int level) { return level / kBarrierLevel; }
/// The rule of a curved cell of `level`, where the setup's `degree` is that of level 0.
template <int Dim>
const std::vector<QuadraturePoint<Dim>>& cell_quadrature(int level, int degree) {
  return closed_level(level) == 0 ? quadrature<Dim>(degree) : closed_quadrature<Dim>(closed_level(level));
}

inline constexpr int kMassDegree = 4;  ///< products of two quadratic functions

}  // namespace itr
