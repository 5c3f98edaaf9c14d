// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "newton/newton.hpp"

namespace itr {

/// A Newton system of a Hessian H = K + U U^T: K is what the system below assembles, U has a column for each RankOne of the
/// energy. Solves by those with K alone (Woodbury; Golub & Van Loan 2013, §2.1.4). H is positive definite where K is.
class RankOneSystem final : public NewtonSystem {
 public:
  explicit RankOneSystem(NewtonSystem& system) : system_(system) {}

  void assemble(const Energy& energy, ConstVectorView x, PsdProjection psd, const DofMap& dofs, PrescribedMotion& motion,
                Workspace& workspace) override {
    system_.assemble(energy, x, psd, dofs, motion, workspace);
    std::vector<RankOne> parts;
    energy.add_rank_ones(x, parts);
    U_ = MatrixX::Zero(dofs.num_unknowns, static_cast<Eigen::Index>(parts.size()));
    Z_.resize(0, 0);
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
    Z_.resize(0, 0);
    // The system below meets other right-hand sides in between, so that it cannot go on with this one.
    const linear::Asked anew{asked.residual, asked.loose, asked.if_indefinite};
    linear::SystemReport report = system_.solve(shift, rhs, anew, solution);
    if (solution.size() == 0 || !has_solution(report) || U_.cols() == 0) return report;
    // Columns change little from one Newton iteration to the next: what the last ones leave is solved for.
    const bool has_guess = shift.value == 0 && guess_.rows() == U_.rows() && guess_.cols() == U_.cols();
    const Product of_K = has_guess ? system_.product() : Product();
    MatrixX Z = of_K ? guess_ : MatrixX::Zero(U_.rows(), U_.cols());
    VectorX of_column(U_.cols()), left(U_.rows()), more(U_.rows());
    for (Eigen::Index k = 0; k < U_.cols(); ++k) {
      left.setZero();
      if (of_K) of_K(Z.col(k), left);
      left = U_.col(k) - left;
      of_column[k] = left.norm();
      const double part = of_column[k] / U_.col(k).norm();
      if (!(part > asked.loose)) continue;
      const linear::Asked rest{std::min(kLeastDigits, asked.residual / part), std::min(kLeastDigits, asked.loose / part),
                               asked.if_indefinite};
      const linear::SystemReport of = system_.solve(shift, left, rest, more);
      if (!has_solution(of)) return of;
      Z.col(k) += more;
      of_column[k] *= of.residual;
      if (report.definiteness == linear::Definiteness::unknown) report.definiteness = of.definiteness;
    }
    set_columns(std::move(Z));
    if (shift.value == 0) guess_ = Z_;
    const VectorX weights = correct(solution);
    if (rhs.norm() > 0) report.residual += weights.cwiseAbs().dot(of_column) / rhs.norm();
    return report;
  }
  linear::SystemReport factorize(const Shift& shift) override {
    Z_.resize(0, 0);
    return system_.factorize(shift);
  }
  linear::SolveReport solve_again(ConstVectorView rhs, VectorView solution) override {
    const linear::SolveReport report = system_.solve_again(rhs, solution);
    if (report.outcome != linear::Outcome::ok || U_.cols() == 0) return report;
    if (!find_columns()) return {linear::Outcome::failed};
    correct(solution);
    return report;
  }
  bool solve_columns(const MatrixX& B, MatrixX& X) override {
    if (!system_.solve_columns(B, X) || !find_columns()) return false;
    for (Eigen::Index k = 0; k < B.cols(); ++k) correct(X.col(k));
    return true;
  }
  bool tells_definiteness() const override { return system_.tells_definiteness(); }
  bool sees_all_directions() const override { return system_.sees_all_directions(); }
  Product product() const override {
    if (Product of_K = system_.product())
      return [of_K, U = U_](ConstVectorView v, VectorView Hv) {
        of_K(v, Hv);
        Hv += U * (U.transpose() * v);
      };
    return {};
  }
  std::string message() const override { return system_.message(); }
  double diagonal_scale() const override {
    return std::max(system_.diagonal_scale(), U_.size() > 0 ? U_.cwiseAbs2().maxCoeff() : 0.0);
  }
  double curvature_of(const Shift& shift, ConstVectorView step) const override { return system_.curvature_of(shift, step); }

 private:
  static constexpr double kLeastDigits = 0.1;  ///< residual of what a guess leaves, at most

  static bool has_solution(const linear::SystemReport& report) {
    return report.outcome == linear::Outcome::ok || report.outcome == linear::Outcome::not_converged;
  }
  void set_columns(MatrixX Z) {
    Z_ = std::move(Z);
    small_.compute(MatrixX::Identity(U_.cols(), U_.cols()) + U_.transpose() * Z_);
  }
  bool find_columns() {
    if (Z_.cols() == U_.cols()) return true;
    MatrixX Z;
    if (!system_.solve_columns(U_, Z)) return false;
    set_columns(std::move(Z));
    return true;
  }
  /// Makes a solution with K one with H. Returns the weights of Z's columns.
  VectorX correct(VectorView solution) const {
    const VectorX weights = small_.solve(U_.transpose() * solution);
    solution -= Z_ * weights;
    return weights;
  }

  NewtonSystem& system_;
  MatrixX U_;                           ///< by unknown, with the roots of the factors
  MatrixX guess_;                       ///< Z of the last solve without a shift
  MatrixX Z_;                           ///< K^-1 U, with the shift of the last solve; empty: not known
  Eigen::PartialPivLU<MatrixX> small_;  ///< of 1 + U^T K^-1 U
};

}  // namespace itr
