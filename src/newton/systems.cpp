// SPDX-License-Identifier: MIT
#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "itr/newton/newton.hpp"

namespace itr {

bool NewtonSystem::solve_columns(const MatrixX& B, MatrixX& X) {
  X.resize(B.rows(), B.cols());
  for (Eigen::Index j = 0; j < B.cols(); ++j)
    if (solve(B.col(j), X.col(j)).outcome != linear::Outcome::ok) return false;
  return X.allFinite();
}

void DenseSystem::assemble(const Energy& energy, ConstVectorView x, PsdProjection psd, const DofMap& dofs,
                           PrescribedMotion& motion, Workspace& workspace) {
  order_ = dofs.num_unknowns;
  hessian_.resize(order_ * order_).setZero();
  HessianSink sink(dofs, hessian_.matrix(order_));
  sink.set_motion(motion);
  energy.add_hessian(x, psd, sink, workspace);
}

linear::Outcome DenseSystem::factorize(double shift) {
  factor_.resize(order_ * order_) = hessian_.view();
  Eigen::Ref<MatrixX> factor = factor_.matrix(order_);
  if (shift != 0) factor.diagonal().array() += shift;
  const Eigen::LLT<Eigen::Ref<MatrixX>, Eigen::Lower> llt(factor);  // in place
  return llt.info() == Eigen::Success ? linear::Outcome::ok : linear::Outcome::not_positive_definite;
}

linear::SolveReport DenseSystem::solve(ConstVectorView rhs, VectorView solution) {
  const auto lower = factor_.matrix(order_).triangularView<Eigen::Lower>();
  solution = rhs;
  lower.solveInPlace(solution);
  lower.adjoint().solveInPlace(solution);
  return {solution.allFinite() ? linear::Outcome::ok : linear::Outcome::non_finite, 0};
}

double DenseSystem::diagonal_scale() const {
  double scale = 0;
  for (Eigen::Index i = 0; i < order_; ++i) scale = std::max(scale, std::abs(hessian_.view()[(order_ + 1) * i]));
  return scale;
}

void SparseSystem::reset(const DofMap& dofs, int dim, std::vector<Stencils> stencils) {
  dim_ = dim;
  pattern_changed_ = true;
  may_keep_order_ = false;
  assembler_.reset(dofs, dim, std::move(stencils));
}

void SparseSystem::assemble(const Energy& energy, ConstVectorView x, PsdProjection psd, const DofMap& dofs,
                            PrescribedMotion& motion, Workspace& workspace) {
  assembler_.begin();
  HessianSink sink(dofs, assembler_);
  sink.set_motion(motion);
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

std::span<const double> SparseSystem::shifted(double shift) {
  if (shift == 0) return assembler_.values();
  shifted_.assign(assembler_.values().begin(), assembler_.values().end());
  for (int j = 0; j < assembler_.pattern().order; ++j) shifted_[assembler_.pattern().column_starts[j]] += shift;
  return shifted_;
}

linear::Outcome SparseSystem::factorize(double shift) {
  const auto outcome = analyze();
  return outcome == linear::Outcome::ok ? solver_.factorize(shifted(shift)) : outcome;
}

linear::Outcome SparseSystem::prepare(double shift, ConstVectorView rhs, double asked) {
  if (!reusing_) return factorize(shift);
  const auto outcome = analyze();
  if (outcome != linear::Outcome::ok) return outcome;
  return reusing_->prepare(shifted(shift), {rhs.data(), static_cast<std::size_t>(rhs.size())}, asked);
}

linear::SolveReport SparseSystem::solve(ConstVectorView rhs, VectorView solution) {
  return solver_.solve({rhs.data(), static_cast<std::size_t>(rhs.size())},
                       {solution.data(), static_cast<std::size_t>(solution.size())}, 1, kTightResidual);
}

bool SparseSystem::solve_columns(const MatrixX& B, MatrixX& X) {
  constexpr double kRough = 1e-4;  // directions are only turned by it
  X.resize(B.rows(), B.cols());
  const auto report = solver_.solve({B.data(), static_cast<std::size_t>(B.size())},
                                    {X.data(), static_cast<std::size_t>(X.size())}, static_cast<int>(B.cols()), kRough);
  return report.outcome == linear::Outcome::ok && X.allFinite();
}

std::string SparseSystem::message() const { return std::string(solver_.name()) + ": " + solver_.message(); }

double SparseSystem::diagonal_scale() const {
  double scale = 0;
  for (int j = 0; j < assembler_.pattern().order; ++j)
    scale = std::max(scale, std::abs(assembler_.values()[assembler_.pattern().column_starts[j]]));
  return scale;
}

}  // namespace itr
