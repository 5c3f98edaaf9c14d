// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <vector>

#include "newton/newton.hpp"

namespace itr {

inline bool has_solved(const linear::SolveReport& report) {
  return report.outcome == linear::Outcome::ok || report.outcome == linear::Outcome::not_converged;
}

/// Lanczos' method for H v = theta P v with the matrix P that `system` was given last (Golub & Van Loan 2013, §10.1), with
/// all vectors kept orthogonal in P.
class Lanczos {
 public:
  /// All must outlive it.
  Lanczos(NewtonSystem& system, const NewtonSystem::Product& H, const NewtonSystem::Product& P)
      : system_(system), H_(H), P_(P) {}

  /// Begins with P^-1 start, which has more of soft modes.
  bool begin(const VectorX& start) {
    next_.resize(start.size());
    return has_solved(system_.solve_again(start, next_)) && append();
  }
  /// One vector more. False where there is none, or where a solve fails.
  bool extend() {
    VectorX Hv(next_.size());
    H_(vectors_.back(), Hv);
    alpha_.push_back(vectors_.back().dot(Hv));
    next_.setZero();
    if (!has_solved(system_.solve_again(Hv, next_))) return false;
    for (int round = 0; round < 2; ++round)
      for (std::size_t i = 0; i < vectors_.size(); ++i) next_ -= images_[i].dot(next_) * vectors_[i];
    analyze();
    return append();
  }
  /// Norm of P^-1 start, in P.
  double first_norm() const { return first_norm_; }
  /// The least first.
  const VectorX& eigenvalues() const { return thetas_; }
  /// In the basis of the vectors, a column for each.
  const MatrixX& eigenvectors() const { return ritz_; }
  double least() const { return thetas_.size() > 0 ? thetas_[0] : 1; }
  /// By how much an eigenvalue may differ from the least one.
  double uncertainty() const { return beta_.empty() ? 1 : residual_of(ritz_.col(0)); }
  /// Norm, in P^-1, of what is missing in the space of the vectors of H times their sum with `coefficients`.
  double residual_of(const VectorX& coefficients) const {
    return beta_.empty() ? 0 : std::abs(beta_.back() * coefficients[coefficients.size() - 1]);
  }
  VectorX sum_of(const VectorX& coefficients) const {
    VectorX v = VectorX::Zero(next_.size());
    for (Eigen::Index i = 0; i < coefficients.size(); ++i) v += coefficients[i] * vectors_[i];
    return v;
  }

 private:
  bool append() {
    VectorX image(next_.size());
    P_(next_, image);
    const double norm = std::sqrt(std::max(0.0, next_.dot(image)));
    if (vectors_.empty())
      first_norm_ = norm;
    else
      beta_.push_back(norm);
    if (!(norm > (vectors_.empty() ? 0 : kExhausted))) return false;
    vectors_.push_back(next_ / norm);
    images_.push_back(image / norm);
    return true;
  }

  void analyze() {
    const auto n = static_cast<Eigen::Index>(alpha_.size());
    Eigen::SelfAdjointEigenSolver<MatrixX> solver;
    const VectorX diagonal = Eigen::Map<const VectorX>(alpha_.data(), n),
                  off = Eigen::Map<const VectorX>(beta_.data(), n - 1);
    solver.computeFromTridiagonal(diagonal, off);
    thetas_ = solver.eigenvalues();
    ritz_ = solver.eigenvectors();
  }

  static constexpr double kExhausted = 1e-7;  // of vectors whose norm is 1: what is left is round-off of the solves

  NewtonSystem& system_;
  const NewtonSystem::Product &H_, &P_;
  VectorX next_;
  std::vector<VectorX> vectors_, images_;  ///< orthonormal in P, and P times them
  std::vector<double> alpha_, beta_;
  double first_norm_ = 0;
  VectorX thetas_;
  MatrixX ritz_;
};

}  // namespace itr
