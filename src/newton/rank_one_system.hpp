// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "linear/low_rank.hpp"
#include "newton/newton.hpp"

namespace itr {

/// A Newton system of a Hessian H = K + U U^T: K is what the system below assembles, U has a column for each RankOne of the
/// energy. U U^T is never assembled. H is positive definite where K is.
class RankOneSystem final : public NewtonSystem {
 public:
  explicit RankOneSystem(NewtonSystem& system) : system_(system) {}

  void assemble(const Energy& energy, ConstVectorView x, PsdProjection psd, const DofMap& dofs, PrescribedMotion& motion,
                Workspace& workspace) override {
    system_.assemble(energy, x, psd, dofs, motion, workspace);
    std::vector<RankOne> parts;
    energy.add_rank_ones(x, parts);
    U_ = MatrixX::Zero(dofs.num_unknowns, static_cast<Eigen::Index>(parts.size()));
    correction_.clear();
    for (Eigen::Index k = 0; k < U_.cols(); ++k) {
      const VectorX vector = std::sqrt(parts[k].factor) * parts[k].vector;
      for (Eigen::Index i = 0; i < vector.size(); ++i)
        if (dofs.unknown[i] != kNone) U_(dofs.unknown[i], k) = vector[i];
      if (motion.step.size() == 0) continue;
      const double along = vector.dot(motion.step);
      motion.coupling += along * U_.col(k);
      motion.curvature += along * along;
    }
  }
  linear::SystemReport solve(const Shift& shift, ConstVectorView rhs, const linear::Asked& asked,
                             VectorView solution) override {
    correction_.clear();
    return U_.cols() == 0 ? system_.solve(shift, rhs, asked, solution)
                          : system_.solve_beside(U_, shift, rhs, asked, solution);
  }
  linear::SystemReport factorize(const Shift& shift) override {
    correction_.clear();
    return system_.factorize(shift);
  }
  linear::SolveReport solve_again(ConstVectorView rhs, VectorView solution) override {
    const linear::SolveReport report = system_.solve_again(rhs, solution);
    if (report.outcome != linear::Outcome::ok || U_.cols() == 0) return report;
    if (!find_columns()) return {linear::Outcome::failed};
    correction_.correct(solution);
    return report;
  }
  bool solve_columns(const MatrixX& B, MatrixX& X) override {
    if (!system_.solve_columns(B, X) || !find_columns()) return false;
    for (Eigen::Index k = 0; k < B.cols(); ++k) correction_.correct(X.col(k));
    return true;
  }
  bool tells_definiteness() const override { return system_.tells_definiteness(); }
  bool sees_all_directions() const override { return system_.sees_all_directions(); }
  Product product() const override {
    if (Product of_K = system_.product())
      return [of_K, U = U_](ConstVectorView v, VectorView Hv) {
        of_K(v, Hv);
        linear::add_low_rank(U, v, Hv);
      };
    return {};
  }
  std::string message() const override { return system_.message(); }
  double diagonal_scale() const override {
    return std::max(system_.diagonal_scale(), U_.size() > 0 ? U_.cwiseAbs2().maxCoeff() : 0.0);
  }
  double curvature_of(const Shift& shift, ConstVectorView step) const override { return system_.curvature_of(shift, step); }

 private:
  bool find_columns() {
    if (correction_.columns() == U_.cols()) return true;
    MatrixX Z;
    if (!system_.solve_columns(U_, Z)) return false;
    correction_.set_columns(U_, std::move(Z));
    return true;
  }

  NewtonSystem& system_;
  MatrixX U_;                             ///< by unknown, with the roots of the factors
  linear::LowRankCorrection correction_;  ///< of the factor, with the shift of the last solve; without columns: not known
};

}  // namespace itr
