// SPDX-License-Identifier: MIT
// An energy's derivatives against central differences, and what its projected Hessians promise.
#pragma once

#include "energy/energy.hpp"

namespace itr {

inline DofMap all_free(Eigen::Index dofs) { return DofMap::from_held(std::vector<char>(dofs, 0)); }

MatrixX hessian_of(const Energy& energy, const VectorX& x, PsdProjection psd);
VectorX gradient_of(const Energy& energy, const VectorX& x);
/// Checks both derivatives at x to a relative error that central differences of step `h` reach.
void expect_derivatives(const Energy& energy, const VectorX& x, double h, double tolerance);
void expect_psd(const Energy& energy, const VectorX& x);

}  // namespace itr
