// SPDX-License-Identifier: MIT
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "linear/low_rank.hpp"
#include "newton/newton.hpp"

namespace itr {

linear::SystemReport NewtonSystem::solve(const Shift& shift, ConstVectorView rhs, const linear::Asked& asked,
                                         VectorView solution) {
  const linear::SystemReport report = factorize(shift);
  if (solution.size() == 0) return report;
  return linear::with_solution(report, asked, [&] { return solve_again(rhs, solution); });
}

linear::SystemReport NewtonSystem::solve_beside(const MatrixX& U, const Shift& shift, ConstVectorView rhs,
                                                const linear::Asked& asked, VectorView solution) {
  linear::SystemReport report = solve(shift, rhs, asked, solution);
  if (solution.size() == 0 || !linear::has_solution(report.outcome)) return report;
  linear::LowRankCorrection correction;
  MatrixX Z;
  if (!solve_columns(U, Z)) return {linear::Outcome::failed};
  correction.set_columns(U, std::move(Z));
  correction.correct(solution);
  return report;
}

bool NewtonSystem::solve_columns(const MatrixX& B, MatrixX& X) {
  X.resize(B.rows(), B.cols());
  for (Eigen::Index j = 0; j < B.cols(); ++j)
    if (solve_again(B.col(j), X.col(j)).outcome != linear::Outcome::ok) return false;
  return X.allFinite();
}

void DenseSystem::assemble(const Energy& energy, ConstVectorView x, PsdProjection psd, const DofMap& dofs,
                           PrescribedMotion& motion, Workspace& workspace) {
  order_ = dofs.num_unknowns;
  hessian_.resize(order_ * order_).setZero();
  HessianTarget target(dofs, hessian_.matrix(order_));
  target.set_motion(motion);
  HessianSink sink(target);
  energy.add_hessian(x, psd, sink, workspace);
}

linear::SystemReport DenseSystem::factorize(const Shift& shift) {
  factor_.resize(order_ * order_) = hessian_.view();
  Eigen::Ref<MatrixX> factor = factor_.matrix(order_);
  if (shift.value != 0)
    for (Eigen::Index i = 0; i < order_; ++i) factor(i, i) += shift.of(factor(i, i));
  const Eigen::LLT<Eigen::Ref<MatrixX>, Eigen::Lower> llt(factor);  // in place
  if (llt.info() != Eigen::Success)
    return {.outcome = linear::Outcome::not_positive_definite, .definiteness = linear::Definiteness::indefinite};
  return {.definiteness = linear::Definiteness::positive};
}

linear::SolveReport DenseSystem::solve_again(ConstVectorView rhs, VectorView solution) {
  const auto lower = factor_.matrix(order_).triangularView<Eigen::Lower>();
  solution = rhs;
  lower.solveInPlace(solution);
  lower.adjoint().solveInPlace(solution);
  return {solution.allFinite() ? linear::Outcome::ok : linear::Outcome::non_finite, 0};
}

NewtonSystem::Product DenseSystem::product() const {
  const VectorX all = hessian_.view();
  return [all, n = order_](ConstVectorView v, VectorView Hv) {
    Hv = Eigen::Map<const MatrixX>(all.data(), n, n).selfadjointView<Eigen::Lower>() * v;
  };
}

double DenseSystem::diagonal_scale() const {
  double scale = 0;
  for (Eigen::Index i = 0; i < order_; ++i) scale = std::max(scale, std::abs(hessian_.view()[(order_ + 1) * i]));
  return scale;
}

double DenseSystem::curvature_of(const Shift& shift, ConstVectorView step) const {
  double sum = 0;
  for (Eigen::Index i = 0; i < order_; ++i) sum += shift.of(hessian_.view()[(order_ + 1) * i]) * step[i] * step[i];
  return sum;
}

void SparseSystem::reset(const DofMap& dofs, int dim, std::vector<Stencils> stencils) {
  dim_ = dim;
  pattern_changed_ = true;
  may_keep_order_ = false;
  assembler_.reset(dofs, dim, std::move(stencils));
}

void SparseSystem::assemble(const Energy& energy, ConstVectorView x, PsdProjection psd, const DofMap& dofs,
                            PrescribedMotion& motion, Workspace& workspace) {
  matrix_ = {};
  assembler_.begin();
  HessianTarget target(dofs, assembler_);
  target.set_motion(motion);
  HessianSink sink(target);
  energy.add_hessian(x, psd, sink, workspace);
  if (!assembler_.finish()) return;
  pattern_changed_ = true;
  dofs_.clear();
  coordinates_.clear();
  for (int i = 0; i < static_cast<int>(dofs.unknown.size()); ++i) {
    if (dofs.unknown[i] == kNone) continue;
    dofs_.push_back(i);
    const auto node = x.segment(i - i % dim_, dim_);
    coordinates_.insert(coordinates_.end(), node.begin(), node.end());
  }
}

linear::Outcome SparseSystem::analyze() {
  if (!pattern_changed_) return linear::Outcome::ok;
  const linear::AnalyzeHints hints{
      .block_size = dim_, .dofs = dofs_, .coordinates = coordinates_, .may_keep_order = may_keep_order_};
  const auto outcome = solver_.analyze(assembler_.pattern(), hints);
  if (outcome != linear::Outcome::ok) return outcome;
  pattern_changed_ = false;
  may_keep_order_ = true;
  return outcome;
}

void SparseSystem::shift_by(const Shift& shift) {
  matrix_ = assembler_.values();
  if (shift.value == 0) return;
  shifted_.assign(matrix_.begin(), matrix_.end());
  for (int j = 0; j < assembler_.pattern().order; ++j) {
    double& entry = shifted_[assembler_.pattern().column_starts[j]];
    entry += shift.of(entry);
  }
  matrix_ = shifted_;
}

linear::SystemReport SparseSystem::factorize(const Shift& shift) {
  if (const auto outcome = analyze(); outcome != linear::Outcome::ok) return {.outcome = outcome};
  shift_by(shift);
  return linear::describe(solver_.factorize(matrix_), solver_);
}

linear::SystemReport SparseSystem::solve(const Shift& shift, ConstVectorView rhs, const linear::Asked& asked,
                                         VectorView solution) {
  return reusing_ ? solve_with(nullptr, shift, rhs, asked, solution) : NewtonSystem::solve(shift, rhs, asked, solution);
}

linear::SystemReport SparseSystem::solve_beside(const MatrixX& U, const Shift& shift, ConstVectorView rhs,
                                                const linear::Asked& asked, VectorView solution) {
  return reusing_ ? solve_with(&U, shift, rhs, asked, solution) : NewtonSystem::solve_beside(U, shift, rhs, asked, solution);
}

linear::SystemReport SparseSystem::solve_with(const MatrixX* U, const Shift& shift, ConstVectorView rhs,
                                              const linear::Asked& asked, VectorView solution) {
  if (const auto outcome = analyze(); outcome != linear::Outcome::ok) return {.outcome = outcome};
  shift_by(shift);
  return reusing_->solve_system(matrix_, {rhs.data(), static_cast<std::size_t>(rhs.size())}, asked,
                                {solution.data(), static_cast<std::size_t>(solution.size())}, U);
}

/// Iterations may have solved the system of the matrix given last without a factor of it.
bool SparseSystem::has_factor() {
  return !reusing_ || reusing_->has_factor() || solver_.factorize(matrix_) == linear::Outcome::ok;
}

linear::SolveReport SparseSystem::solve_again(ConstVectorView rhs, VectorView solution) {
  if (!has_factor()) return {linear::Outcome::failed};
  return solver_.solve({rhs.data(), static_cast<std::size_t>(rhs.size())},
                       {solution.data(), static_cast<std::size_t>(solution.size())}, 1, kTightResidual);
}

bool SparseSystem::solve_columns(const MatrixX& B, MatrixX& X) {
  // Directions are only turned by it: a factor's solution need not be checked, at a product with the matrix a column.
  const double asked = solver_.capabilities().iterative ? 1e-4 : std::numeric_limits<double>::infinity();
  if (!has_factor()) return false;
  X.resize(B.rows(), B.cols());
  const auto report = solver_.solve({B.data(), static_cast<std::size_t>(B.size())},
                                    {X.data(), static_cast<std::size_t>(X.size())}, static_cast<int>(B.cols()), asked);
  return report.outcome == linear::Outcome::ok && X.allFinite();
}

NewtonSystem::Product SparseSystem::product() const {
  const linear::SparsityPattern& pattern = assembler_.pattern();
  const auto values = assembler_.values();
  return [pattern, values = std::vector<double>(values.begin(), values.end())](ConstVectorView v, VectorView Hv) {
    Hv.setZero();
    for (int j = 0; j < pattern.order; ++j) {
      const int diagonal = pattern.column_starts[j];
      Hv[j] += values[diagonal] * v[j];
      for (int k = diagonal + 1; k < pattern.column_starts[j + 1]; ++k) {
        Hv[pattern.row_indices[k]] += values[k] * v[j];
        Hv[j] += values[k] * v[pattern.row_indices[k]];
      }
    }
  };
}

std::string SparseSystem::message() const { return std::string(solver_.name()) + ": " + solver_.message(); }

double SparseSystem::diagonal_scale() const {
  double scale = 0;
  for (int j = 0; j < assembler_.pattern().order; ++j)
    scale = std::max(scale, std::abs(assembler_.values()[assembler_.pattern().column_starts[j]]));
  return scale;
}

double SparseSystem::curvature_of(const Shift& shift, ConstVectorView step) const {
  double sum = 0;
  for (int j = 0; j < assembler_.pattern().order; ++j)
    sum += shift.of(assembler_.values()[assembler_.pattern().column_starts[j]]) * step[j] * step[j];
  return sum;
}

}  // namespace itr
