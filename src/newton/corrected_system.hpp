// SPDX-License-Identifier: MIT
#pragma once

#include <functional>

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
                Workspace& workspace) override;
  linear::SystemReport solve(const Shift& shift, ConstVectorView rhs, const linear::Asked& asked,
                             VectorView solution) override;
  linear::SystemReport factorize(const Shift& shift) override { return system_.factorize(shift); }
  linear::SolveReport solve_again(ConstVectorView rhs, VectorView solution) override {
    return system_.solve_again(rhs, solution);
  }
  bool solve_columns(const MatrixX& B, MatrixX& X) override;
  bool tells_definiteness() const override { return system_.tells_definiteness(); }
  bool sees_all_directions() const override { return system_.sees_all_directions(); }
  Product product() const override { return system_.product(); }
  std::string message() const override { return system_.message(); }
  double diagonal_scale() const override { return system_.diagonal_scale(); }
  double curvature_of(const Shift& shift, ConstVectorView step) const override { return system_.curvature_of(shift, step); }

 private:
  void correct(ConstVectorView rhs, VectorView solution) const;

  NewtonSystem& system_;
  Modes modes_;
  Product product_;       ///< of the true matrix at the iterate
  MatrixX by_unknown_;    ///< modes
  MatrixX combinations_;  ///< of the modes, which the true matrix does not couple
  VectorX stiffness_;     ///< of these combinations, by the known one; empty: nothing is corrected
};

}  // namespace itr
