// SPDX-License-Identifier: MIT
#pragma once

#include "itr/newton/newton.hpp"

namespace itr {

/// A unit vector along which the assembled Hessian H of `system` has negative curvature, by inverse iteration with a shift
/// that makes H positive definite (Golub & Van Loan 2013, §8.2). Returns v^T H v, not below 0 where none was found.
double find_negative_curvature(NewtonSystem& system, int unknowns, VectorX& v);

}  // namespace itr
