// SPDX-License-Identifier: MIT
#include "curvature.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/noise.hpp"

namespace itr {

namespace {

/// Orients eigenvectors: orthogonal to none of them but by accident, whatever the symmetry of the scene.
VectorX vector_without_symmetry(int unknowns) {
  VectorX v(unknowns);
  for (int i = 0; i < unknowns; ++i) v[i] = 1 + 0.5 * std::sin(i + 1.0);
  return v.normalized();
}

/// Has about as much of each eigenvector, so that Lanczos' method finds all of them soon.
VectorX vector_of_noise(int unknowns) {
  return VectorX::NullaryExpr(unknowns, [](Eigen::Index i) { return noise(static_cast<std::uint64_t>(i)); }).normalized();
}

bool has_solved(const linear::SolveReport& report) {
  return report.outcome == linear::Outcome::ok || report.outcome == linear::Outcome::not_converged;
}

/// Lanczos' method for the least theta of H v = theta P v, with all vectors kept orthogonal.
class Lanczos {
 public:
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
  double least() const { return least_; }
  /// By how much an eigenvalue may differ from it.
  double uncertainty() const { return beta_.empty() ? 1 : std::abs(beta_.back() * ritz_[ritz_.size() - 1]); }
  VectorX eigenvector() const {
    VectorX v = VectorX::Zero(next_.size());
    for (Eigen::Index i = 0; i < ritz_.size(); ++i) v += ritz_[i] * vectors_[i];
    return v.normalized();
  }

 private:
  bool append() {
    VectorX image(next_.size());
    P_(next_, image);
    const double norm = std::sqrt(std::max(0.0, next_.dot(image)));
    if (!vectors_.empty()) beta_.push_back(norm);
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
    least_ = solver.eigenvalues()[0];
    ritz_ = solver.eigenvectors().col(0);
  }

  static constexpr double kExhausted = 1e-7;  // of vectors whose norm is 1: what is left is round-off of the solves

  NewtonSystem& system_;
  const NewtonSystem::Product &H_, &P_;
  VectorX next_, ritz_;
  std::vector<VectorX> vectors_, images_;  ///< orthonormal in P, and P times them
  std::vector<double> alpha_, beta_;
  double least_ = 1;
};

}  // namespace

double find_negative_curvature(NewtonSystem& system, int unknowns, VectorX& v) {
  constexpr int kMostShifts = 14, kMostSolves = 30;
  constexpr double kSettled = 0.05;  // relative change of the curvature
  const auto is_definite = [&](double shift) {
    const linear::SystemReport report = system.factorize(shift);
    return report.outcome == linear::Outcome::ok && report.definiteness != linear::Definiteness::indefinite;
  };
  double shift = 1e-10 * std::max(system.diagonal_scale(), 1e-300);
  for (int attempt = 0; !is_definite(shift); ++attempt, shift *= 10)
    if (attempt == kMostShifts) return 0;
  v = vector_without_symmetry(unknowns);
  VectorX next(unknowns);
  double curvature = 0;
  for (int k = 0; k < kMostSolves; ++k) {
    const auto outcome = system.solve_again(v, next).outcome;
    if (outcome != linear::Outcome::ok && outcome != linear::Outcome::not_converged) return 0;
    const double before = curvature;
    curvature = next.dot(v) / next.squaredNorm() - shift;  // (H + shift) next = v
    v = next.normalized();
    if (curvature < 0 && std::abs(curvature - before) < kSettled * -curvature) break;
  }
  return curvature;
}

std::optional<double> find_negative_curvature_by_products(NewtonSystem& system,
                                                          const std::function<void(PsdProjection)>& assemble, int unknowns,
                                                          VectorX& v) {
  constexpr int kMostVectors = 80;
  constexpr double kNegative = -1e-7;  // theta: what solves resolve
  constexpr double kSame = 1e-14;      // relative difference of H and P that is round-off
  constexpr double kSettled = 0.2;     // uncertainty of a negative theta, relative
  constexpr double kCertain = 1e-4;    // of a positive one: less certain, it hides another that the start has little of
  constexpr double kShift = 1e-10;     // of a projected Hessian that has no factor, by the largest entry
  assemble(PsdProjection::none);
  const NewtonSystem::Product H = system.product();
  const double scale = system.diagonal_scale();
  assemble(PsdProjection::clamp);
  const NewtonSystem::Product projected = system.product();
  if (!H || !projected) return std::nullopt;
  const VectorX start = vector_of_noise(unknowns);
  VectorX Hv(unknowns), Pv(unknowns);
  H(start, Hv);
  projected(start, Pv);
  if ((Hv - Pv).norm() <= kSame * Pv.norm()) return 0;
  double shift = 0;
  if (system.factorize(0).outcome != linear::Outcome::ok) {
    shift = kShift * std::max(scale, system.diagonal_scale());
    if (system.factorize(shift).outcome != linear::Outcome::ok) return std::nullopt;
  }
  const NewtonSystem::Product P = [&](ConstVectorView x, VectorView Px) {
    projected(x, Px);
    Px += shift * x;
  };
  Lanczos lanczos(system, H, P);
  if (!lanczos.begin(start)) return std::nullopt;
  for (int k = 0; k < kMostVectors && lanczos.extend(); ++k) {
    const double least = lanczos.least(), off = lanczos.uncertainty();
    if (least < kNegative ? off < -kSettled * least : off < kCertain * least) break;
  }
  if (!(lanczos.least() < kNegative)) return 0;
  v = lanczos.eigenvector();
  if (v.dot(vector_without_symmetry(unknowns)) < 0) v = -v;
  H(v, Hv);
  return v.dot(Hv);
}

}  // namespace itr
