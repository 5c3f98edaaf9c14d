// SPDX-License-Identifier: MIT
// With F = U diag(s) V^T and dF = U A V^T, the second derivative is mu A + c S^-1 A^T S^-1 + l (S^-1 : A) S^-1, where
// l = lambda + p J and c = mu - lambda ln J - p J. Diagonal entries of A decouple from the others; each pair (A_ij, A_ji)
// has one symmetric and one skew mode (Smith et al. 2019, "Analytic eigensystems for isotropic distortion energies").
#include "energy/elastic/neo_hookean.hpp"

#include <Eigen/Eigenvalues>
#include <cmath>

#include "isotropic.hpp"
#include "point.hpp"

namespace itr {

template <int Dim>
double neo_hookean_density(const Mat<Dim>& F, const LameParameters& lame) {
  return NeoHookeanPoint<Dim>(DisplacementGradient<Dim>::of(F), lame).density();
}

template <int Dim>
Mat<Dim> neo_hookean_stress(const Mat<Dim>& F, const LameParameters& lame) {
  const NeoHookeanPoint<Dim> point(DisplacementGradient<Dim>::of(F), lame);
  return point.stress(point.inverse());
}

namespace {

/// The numbers l and c.
template <int Dim>
std::array<double, 2> volume_stiffness(const Mat<Dim>& F, const LameParameters& lame) {
  const double J = F.determinant(), pJ = lame.pressure * J;
  return {lame.lambda + pJ, lame.mu - lame.lambda * std::log(J) - pJ};
}

/// d2W / ds_i ds_j of the singular values.
template <int Dim>
Eigen::SelfAdjointEigenSolver<Mat<Dim>> decompose_stretch(const Vec<Dim>& s, double mu, double l, double c) {
  Mat<Dim> stretch;
  for (int i = 0; i < Dim; ++i)
    for (int j = 0; j < Dim; ++j) stretch(i, j) = l / (s[i] * s[j]) + (i == j ? mu + c / (s[i] * s[i]) : 0);
  Eigen::SelfAdjointEigenSolver<Mat<Dim>> solver;
  if constexpr (Dim == 2)
    solver.computeDirect(stretch);
  else
    solver.compute(stretch);
  return solver;
}

/// Calls visit(value, mode) for the symmetric and the skew mode of each pair.
template <int Dim, typename Visit>
void visit_pairs(const SingularValues<Dim>& svd, double mu, double c, const Visit& visit) {
  const double half = std::sqrt(0.5);
  for (int i = 0; i < Dim; ++i)
    for (int j = i + 1; j < Dim; ++j)
      for (const double sign : {1.0, -1.0})
        visit(mu + sign * c / (svd.s[i] * svd.s[j]), [&, i, j, sign] {
          return Mat<Dim>(half * svd.U.col(i) * svd.V.col(j).transpose() +
                          sign * half * svd.U.col(j) * svd.V.col(i).transpose());
        });
}

}  // namespace

template <int Dim>
EigenSystem<Dim> neo_hookean_eigensystem(const Mat<Dim>& F, const LameParameters& lame) {
  const SingularValues<Dim> svd = singular_values(F);
  const auto [l, c] = volume_stiffness<Dim>(F, lame);
  const auto stretch = decompose_stretch<Dim>(svd.s, lame.mu, l, c);
  EigenSystem<Dim> system;
  int k = 0;
  for (; k < Dim; ++k) {
    system.values[k] = stretch.eigenvalues()[k];
    system.modes[k] = svd.U * stretch.eigenvectors().col(k).asDiagonal() * svd.V.transpose();
  }
  visit_pairs<Dim>(svd, lame.mu, c, [&](double value, const auto& mode) {
    system.values[k] = value;
    system.modes[k++] = mode();
  });
  return system;
}

template <int Dim>
NegativeModes<Dim> neo_hookean_negative_modes(const Mat<Dim>& F, const LameParameters& lame) {
  const SingularValues<Dim> svd = singular_values(F);
  const auto [l, c] = volume_stiffness<Dim>(F, lame);
  NegativeModes<Dim> negative;
  if (c < 0 || l < 0) {  // else the stretches are a sum of positive terms
    const auto stretch = decompose_stretch<Dim>(svd.s, lame.mu, l, c);
    for (int k = 0; k < Dim && stretch.eigenvalues()[k] < 0; ++k) {
      negative.values[negative.count] = stretch.eigenvalues()[k];
      negative.modes[negative.count++] = svd.U * stretch.eigenvectors().col(k).asDiagonal() * svd.V.transpose();
    }
  }
  visit_pairs<Dim>(svd, lame.mu, c, [&](double value, const auto& mode) {
    if (value >= 0) return;
    negative.values[negative.count] = value;
    negative.modes[negative.count++] = mode();
  });
  return negative;
}

#define ITR_INSTANTIATE(Dim)                                                                      \
  template double neo_hookean_density<Dim>(const Mat<Dim>&, const LameParameters&);               \
  template Mat<Dim> neo_hookean_stress<Dim>(const Mat<Dim>&, const LameParameters&);              \
  template EigenSystem<Dim> neo_hookean_eigensystem<Dim>(const Mat<Dim>&, const LameParameters&); \
  template NegativeModes<Dim> neo_hookean_negative_modes<Dim>(const Mat<Dim>&, const LameParameters&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
