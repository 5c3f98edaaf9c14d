// SPDX-License-Identifier: MIT
// Squared distances between points, edges and triangles, and where the closest points are.
//
// All of these return *squared* distances [m^2]. Derivatives are with respect to the stacked positions of the arguments in
// their order.
#pragma once

#include "itr/core/types.hpp"

namespace itr {

/// Which part of an edge is closest to a point.
enum class EdgeFeature { vertex0, vertex1, interior };

/// For the segment a b and the point p. A degenerate edge counts as vertex0.
template <int Dim>
EdgeFeature closest_feature_on_edge(const Vec<Dim>& p, const Vec<Dim>& a, const Vec<Dim>& b);

/// |p - q|^2.
template <int Dim>
double point_point_distance_squared(const Vec<Dim>& p, const Vec<Dim>& q);
template <int Dim>
Vec<2 * Dim> point_point_distance_squared_gradient(const Vec<Dim>& p, const Vec<Dim>& q);
template <int Dim>
Mat<2 * Dim> point_point_distance_squared_hessian();

/// Squared distance of p to the *line* through a and b (the caller has found that the interior is closest).
template <int Dim>
double point_line_distance_squared(const Vec<Dim>& p, const Vec<Dim>& a, const Vec<Dim>& b);
template <int Dim>
Vec<3 * Dim> point_line_distance_squared_gradient(const Vec<Dim>& p, const Vec<Dim>& a, const Vec<Dim>& b);
template <int Dim>
Mat<3 * Dim> point_line_distance_squared_hessian(const Vec<Dim>& p, const Vec<Dim>& a, const Vec<Dim>& b);

/// Squared distance of p to the segment a b.
template <int Dim>
double point_edge_distance_squared(const Vec<Dim>& p, const Vec<Dim>& a, const Vec<Dim>& b);

/// Squared distance of two segments in 3D (parallel, collinear and degenerate ones included).
double edge_edge_distance_squared(const Vec<3>& a0, const Vec<3>& a1, const Vec<3>& b0, const Vec<3>& b1);
/// Squared distance of p to the triangle a b c.
double point_triangle_distance_squared(const Vec<3>& p, const Vec<3>& a, const Vec<3>& b, const Vec<3>& c);

}  // namespace itr
