// SPDX-License-Identifier: MIT
// With F = U diag(s) V^T and dF = U A V^T, the second derivative is mu A + c S^-1 A^T S^-1 + lambda (S^-1 : A) S^-1, where
// c = mu - lambda ln J. Diagonal entries of A decouple from the others; each pair (A_ij, A_ji) has one symmetric and one
// skew mode (Smith et al. 2019, "Analytic eigensystems for isotropic distortion energies").
#include "itr/energy/elastic/neo_hookean.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "isotropic.hpp"

namespace itr {

template <int Dim>
double neo_hookean_density(const Mat<Dim>& F, const LameParameters& lame) {
  const double J = F.determinant();
  if (!(J > 0)) return std::numeric_limits<double>::infinity();
  const double log_J = std::log(J);
  return lame.mu / 2 * (F.squaredNorm() - Dim - 2 * log_J) + lame.lambda / 2 * log_J * log_J;
}

template <int Dim>
Mat<Dim> neo_hookean_stress(const Mat<Dim>& F, const LameParameters& lame) {
  const Mat<Dim> inverse_transposed = F.inverse().transpose();
  return lame.mu * F + (lame.lambda * std::log(F.determinant()) - lame.mu) * inverse_transposed;
}

template <int Dim>
EigenSystem<Dim> neo_hookean_eigensystem(const Mat<Dim>& F, const LameParameters& lame) {
  const auto [U, V, s] = singular_values(F);
  const double c = lame.mu - lame.lambda * std::log(F.determinant());
  Mat<Dim> stretch;
  for (int i = 0; i < Dim; ++i)
    for (int j = 0; j < Dim; ++j) stretch(i, j) = lame.lambda / (s[i] * s[j]) + (i == j ? lame.mu + c / (s[i] * s[i]) : 0);
  Eigen::SelfAdjointEigenSolver<Mat<Dim>> solver;
  if constexpr (Dim == 2) {
    solver.computeDirect(stretch);
  } else {
    solver.compute(stretch);
  }
  EigenSystem<Dim> system;
  int k = 0;
  for (; k < Dim; ++k) {
    system.values[k] = solver.eigenvalues()[k];
    system.modes[k] = U * solver.eigenvectors().col(k).asDiagonal() * V.transpose();
  }
  const double half = std::sqrt(0.5);
  for (int i = 0; i < Dim; ++i)
    for (int j = i + 1; j < Dim; ++j) {
      const Mat<Dim> first = half * U.col(i) * V.col(j).transpose(), second = half * U.col(j) * V.col(i).transpose();
      system.values[k] = lame.mu + c / (s[i] * s[j]);
      system.modes[k++] = first + second;
      system.values[k] = lame.mu - c / (s[i] * s[j]);
      system.modes[k++] = first - second;
    }
  return system;
}

#define ITR_INSTANTIATE(Dim)                                                         \
  template double neo_hookean_density<Dim>(const Mat<Dim>&, const LameParameters&);  \
  template Mat<Dim> neo_hookean_stress<Dim>(const Mat<Dim>&, const LameParameters&); \
  template EigenSystem<Dim> neo_hookean_eigensystem<Dim>(const Mat<Dim>&, const LameParameters&);
ITR_INSTANTIATE(2)
ITR_INSTANTIATE(3)
#undef ITR_INSTANTIATE

}  // namespace itr
