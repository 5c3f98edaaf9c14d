// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Eigenvalues>

#include "energy/energy.hpp"

namespace itr {

/// A symmetric block with its negative eigenvalues projected.
template <typename Matrix>
void project_block(Matrix& block, PsdProjection psd) {
  if (psd == PsdProjection::none) return;
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(block);
  const auto values = eigen.eigenvalues().unaryExpr([psd](double value) { return projected(value, psd); }).eval();
  block = eigen.eigenvectors() * values.asDiagonal() * eigen.eigenvectors().transpose();
}

}  // namespace itr
