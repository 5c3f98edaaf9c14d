// SPDX-License-Identifier: MIT
#include "curvature.hpp"

#include <algorithm>
#include <cmath>

namespace itr {

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
  v.resize(unknowns);
  for (int i = 0; i < unknowns; ++i) v[i] = 1 + 0.5 * std::sin(i + 1.0);  // orthogonal to no eigenvector but by accident
  v.normalize();
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

}  // namespace itr
