// SPDX-License-Identifier: MIT
// Squared distances [m^2] between points, edges and triangles: which features are closest, and derivatives.
//
// A pair of primitives is reduced to its closest features: then the distance is that between the points, lines or planes
// that they span, a smooth function. Derivatives are with respect to the stacked positions of the pair.
#pragma once

#include <span>

#include "itr/types.hpp"

namespace itr {

/// `x`: the positions of the pair. Of equally close features the first in a fixed order is taken. Degenerate edges count as
/// their first vertex, degenerate triangles as their edges, parallel edges as one edge and a vertex of the other.
template <int Dim>
ClosestFeatures closest_features(PairKind kind, const Vec<Dim>* x);

/// The distance of a pair whose own features are closest.
template <int Dim>
PairDistance<Dim> pair_distance(PairKind kind, const Vec<Dim>* x);

/// Hessian of the squared distance of such a pair, in the leading Dim * pair_size(kind) rows and columns.
template <int Dim>
Mat<4 * Dim> pair_distance_hessian(PairKind kind, const Vec<Dim>* x);

/// Orthonormal columns (or zero ones) that span the range of that Hessian and the gradient, in the leading rows: no more
/// than coefficients (x) e_d and, for each parameter of the closest points, one more direction along the separation.
template <int Dim>
Eigen::Matrix<double, 4 * Dim, Dim + 2> pair_distance_range(PairKind kind, const PairDistance<Dim>& pair);

/// Squared distance of the boxes around a pair's two primitives: never more than theirs.
template <int Dim>
double box_distance_squared(PairKind kind, const Vec<Dim>* x);

/// Squared distance of a pair, whatever its closest features.
template <int Dim>
double pair_distance_squared(PairKind kind, const Vec<Dim>* x);

/// Squared distance of p to the segment a b.
template <int Dim>
double point_edge_distance_squared(const Vec<Dim>& p, const Vec<Dim>& a, const Vec<Dim>& b);
/// Squared distance of two segments in 3D (parallel, collinear and degenerate ones included).
double edge_edge_distance_squared(const Vec<3>& a0, const Vec<3>& a1, const Vec<3>& b0, const Vec<3>& b1);
/// Squared distance of p to the triangle a b c.
double point_triangle_distance_squared(const Vec<3>& p, const Vec<3>& a, const Vec<3>& b, const Vec<3>& c);

/// |u x v|^2 of the edges u = a1 - a0, v = b1 - b0: 0 where they are parallel. Positions (a0, a1, b0, b1).
struct CrossSquared {
  double value;
  Vec<12> gradient;
};
double edge_cross_squared(const Vec<3>* x);
CrossSquared edge_cross_squared_with_gradient(const Vec<3>* x);
Mat<12> edge_cross_squared_hessian(const Vec<3>* x);

}  // namespace itr
