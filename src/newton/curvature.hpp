// SPDX-License-Identifier: MIT
#pragma once

#include <functional>
#include <optional>

#include "newton/newton.hpp"

namespace itr {

/// A unit vector along which the assembled Hessian H of `system` has negative curvature, by inverse iteration with a shift
/// that makes H positive definite (Golub & Van Loan 2013, §8.2). Returns v^T H v, not below 0 where none was found.
double find_negative_curvature(NewtonSystem& system, int unknowns, VectorX& v);

/// Finds a direction of negative curvature without a factor, by Lanczos' method for H v = theta P v with the projected
/// Hessian P (Golub & Van Loan 2013, §10.1): most theta are 1, and H is indefinite where one is negative. Leaves P
/// assembled; finds nothing where solves with P fail.
std::optional<double> find_negative_curvature_by_products(NewtonSystem& system,
                                                          const std::function<void(PsdProjection)>& assemble, int unknowns,
                                                          VectorX& v);

}  // namespace itr
