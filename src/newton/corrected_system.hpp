// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Eigenvalues>
#include <functional>
#include <limits>
#include <utility>

#include "newton/newton.hpp"

namespace itr {

/// A Newton system whose solutions are exact along motions that nothing but a small known stiffness resists: there a
/// residual of the usual size stands for a long way.
class CorrectedSystem final : public NewtonSystem {
 public:
  /// Motions at an iterate that may be such ones, as columns over all dofs; orthonormal in the known stiffness.
  using Modes = std::function<MatrixX(ConstVectorView x, const DofMap& dofs)>;
  CorrectedSystem(NewtonSystem& system, Modes modes) : system_(system), modes_(std::move(modes)) {}

  void assemble(const Energy& energy, ConstVectorView x, PsdProjection psd, const DofMap& dofs, PrescribedMotion& motion,
                Workspace& workspace) override {
    // Projecting stencils couples bodies to motions along surfaces that nothing resists: the true matrix corrects.
    system_.assemble(energy, x, PsdProjection::none, dofs, motion, workspace);
    product_ = system_.product();
    if (psd != PsdProjection::none) system_.assemble(energy, x, psd, dofs, motion, workspace);
    const MatrixX modes = modes_(x, dofs);
    by_unknown_.resize(dofs.num_unknowns, modes.cols());
    for (Eigen::Index i = 0; i < modes.rows(); ++i)
      if (dofs.unknown[i] != kNone) by_unknown_.row(dofs.unknown[i]) = modes.row(i);
    stiffness_.resize(0);
    if (!product_) return;
    MatrixX of_modes(by_unknown_.rows(), by_unknown_.cols());
    for (Eigen::Index k = 0; k < modes.cols(); ++k) product_(by_unknown_.col(k), of_modes.col(k));
    const Eigen::SelfAdjointEigenSolver<MatrixX> reduced(by_unknown_.transpose() * of_modes);
    if (reduced.info() != Eigen::Success) return;
    combinations_ = reduced.eigenvectors();
    stiffness_ = reduced.eigenvalues();
  }
  linear::SystemReport solve(const Shift& shift, ConstVectorView rhs, const linear::Asked& asked,
                             VectorView solution) override {
    const linear::SystemReport report = system_.solve(shift, rhs, asked, solution);
    if (solution.size() > 0 && shift.value == 0) correct(rhs, solution);
    return report;
  }
  linear::SystemReport factorize(const Shift& shift) override { return system_.factorize(shift); }
  linear::SolveReport solve_again(ConstVectorView rhs, VectorView solution) override {
    return system_.solve_again(rhs, solution);
  }
  bool solve_columns(const MatrixX& B, MatrixX& X) override {
    if (!system_.solve_columns(B, X)) return false;
    for (Eigen::Index k = 0; k < B.cols(); ++k) correct(B.col(k), X.col(k));
    return true;
  }
  bool tells_definiteness() const override { return system_.tells_definiteness(); }
  bool sees_all_directions() const override { return system_.sees_all_directions(); }
  Product product() const override { return system_.product(); }
  std::string message() const override { return system_.message(); }
  double diagonal_scale() const override { return system_.diagonal_scale(); }
  double curvature_of(const Shift& shift, ConstVectorView step) const override { return system_.curvature_of(shift, step); }

 private:
  /// Makes the residual zero along motions that nothing else resists, and along all of them where projections have not made
  /// the solution another one than that of the true matrix.
  void correct(ConstVectorView rhs, VectorView solution) const {
    constexpr int kRounds = 10;
    constexpr double kGain = 0.5;   ///< of the correction before: one that is not as much smaller is round-off
    constexpr double kKnown = 0.1;  ///< relative: a stiffness that differs by less is the known one
    constexpr double kTrue = 1e-2;  ///< relative residual: the true matrix is as good as the one that was solved with
    if (!product_ || stiffness_.size() == 0 || !solution.allFinite()) return;
    VectorX residual(rhs.size());
    double last = std::numeric_limits<double>::infinity();
    for (int round = 0; round < kRounds; ++round) {
      product_(solution, residual);
      residual = rhs - residual;
      const double most = residual.norm() <= kTrue * rhs.norm() ? std::numeric_limits<double>::infinity() : 1 + kKnown;
      const VectorX inverse =
          stiffness_.unaryExpr([&](double value) { return 1 - kKnown < value && value < most ? 1 / value : 0.0; });
      const VectorX missing = combinations_.transpose() * (by_unknown_.transpose() * residual);
      const VectorX correction = by_unknown_ * (combinations_ * inverse.cwiseProduct(missing));
      if (!(correction.norm() < kGain * last)) return;
      last = correction.norm();
      solution += correction;
    }
  }

  NewtonSystem& system_;
  Modes modes_;
  Product product_;       ///< of the true matrix at the iterate
  MatrixX by_unknown_;    ///< modes
  MatrixX combinations_;  ///< of the modes, which the true matrix does not couple
  VectorX stiffness_;     ///< of these combinations, by the known one; empty: nothing is corrected
};

}  // namespace itr
