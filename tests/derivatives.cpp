// SPDX-License-Identifier: MIT
#include "derivatives.hpp"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

namespace itr {

MatrixX hessian_of(const Energy& energy, const VectorX& x, PsdProjection psd) {
  Workspace workspace;
  const DofMap dofs = all_free(x.size());
  MatrixX lower = MatrixX::Zero(x.size(), x.size());
  HessianTarget target(dofs, lower);
  HessianSink sink(target);
  energy.add_hessian(x, psd, sink, workspace);
  return lower.selfadjointView<Eigen::Lower>();
}

VectorX gradient_of(const Energy& energy, const VectorX& x) {
  Workspace workspace;
  VectorX gradient = VectorX::Zero(x.size());
  energy.add_gradient(x, gradient, workspace);
  return gradient;
}

void expect_derivatives(const Energy& energy, const VectorX& x, double h, double tolerance) {
  Workspace workspace;
  const VectorX gradient = gradient_of(energy, x);
  const MatrixX hessian = hessian_of(energy, x, PsdProjection::none);
  VectorX difference(x.size());
  MatrixX second(x.size(), x.size());
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    VectorX plus = x, minus = x;
    plus[i] += h;
    minus[i] -= h;
    difference[i] = (energy.value(plus, workspace) - energy.value(minus, workspace)) / (2 * h);
    second.col(i) = (gradient_of(energy, plus) - gradient_of(energy, minus)) / (2 * h);
  }
  EXPECT_LE((gradient - difference).norm(), tolerance * (1e-12 + gradient.norm())) << energy.name();
  EXPECT_LE((hessian - second).norm(), tolerance * (1e-12 + hessian.norm())) << energy.name();
}

void expect_psd(const Energy& energy, const VectorX& x) {
  const MatrixX projected = hessian_of(energy, x, PsdProjection::clamp);
  const Eigen::SelfAdjointEigenSolver<MatrixX> eigen(projected);
  EXPECT_GE(eigen.eigenvalues()[0], -1e-10 * projected.norm()) << energy.name();
}

}  // namespace itr
