// SPDX-License-Identifier: MIT
// Where a quadratic simplex is positively oriented: everywhere in it, and all along a straight motion of its nodes. The
// Jacobian matrix is linear in place and in time, so its determinant has a Bernstein form whose coefficients bound it
// (Johnen, Remacle and Geuzaine 2013); subdivision decides where they do not.
#pragma once

#include <limits>

#include "itr/types.hpp"

namespace itr {

/// Positions of the nodes, as columns. A straight edge has its node at the mean of its ends.
template <int Dim>
using QuadraticCell = Eigen::Matrix<double, Dim, kQuadraticNodes<Dim>>;

/// Whether det dx/dxi > 0 everywhere in the closed simplex, proven in floating point; xi are coordinates on the unit
/// simplex. False where it is not, and where the proof would take too many subdivisions.
template <int Dim>
bool is_positive_everywhere(const QuadraticCell<Dim>& x);

/// A lower bound of det dx/dxi over the simplex, nearer to the minimum than `relative_tolerance` times it where few
/// subdivisions suffice. Where `enough` is given: some number that is less than `enough` if and only if the bound is.
template <int Dim>
double min_jacobian_bound(const QuadraticCell<Dim>& x, double relative_tolerance,
                          double enough = std::numeric_limits<double>::infinity());

/// Whether dx/dxi is J (I + E) with |E| < `most` all over the simplex, J its mean over the corners.
template <int Dim>
bool varies_little(const QuadraticCell<Dim>& x, double most);

/// A t in [0, 1] such that x + s dx is proven positive everywhere for all s in [0, t]: 1, or nearer to the largest one than
/// `tolerance` times it where few subdivisions suffice; 0 where x is not positive.
template <int Dim>
double max_positive_step(const QuadraticCell<Dim>& x, const QuadraticCell<Dim>& dx, double tolerance = 0.01);

/// Decides is_positive_everywhere in exact arithmetic, with more subdivisions.
template <int Dim>
bool is_positive_everywhere_exact(const QuadraticCell<Dim>& x);

}  // namespace itr
