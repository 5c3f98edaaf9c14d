// SPDX-License-Identifier: MIT
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

#include "isotropic.hpp"
#include "strain.hpp"

namespace itr {

namespace {

/// F = U diag(1 + stretch) V^T; `stretch` has the relative precision of the strain.
template <int Dim>
struct Stretch {
  Mat<Dim> direction;  ///< V
  Vec<Dim> change;     ///< s - 1
};

/// From the eigenvalues a of C - I: s - 1 = a / (1 + sqrt(1 + a)).
template <int Dim>
Stretch<Dim> small_stretch(const Mat<Dim>& A) {
  const Eigen::SelfAdjointEigenSolver<Mat<Dim>> solver(A);
  const auto a = solver.eigenvalues().array();
  return {solver.eigenvectors(), a / (1 + (1 + a).sqrt())};
}

}  // namespace

template <int Dim>
double fixed_corotated_density(const Mat<Dim>& G, const LameParameters& lame) {
  const Strain<Dim> strain(G);
  const Vec<Dim> change =
      strain.is_small ? small_stretch<Dim>(strain.A).change : Vec<Dim>(singular_values(strain.F).s.array() - 1);
  return lame.mu * change.squaredNorm() + lame.lambda / 2 * strain.J_minus_1 * strain.J_minus_1;
}

/// 2 mu (F - R) + lambda (J - 1) cof F, with F - R = F V diag((s - 1) / s) V^T.
template <int Dim>
Mat<Dim> fixed_corotated_stress(const Mat<Dim>& G, const LameParameters& lame) {
  const Strain<Dim> strain(G);
  const Mat<Dim> of_volume = lame.lambda * strain.J_minus_1 * strain.J() * strain.inverse_transpose();
  if (strain.is_small) {
    const Stretch<Dim> stretch = small_stretch<Dim>(strain.A);
    const Vec<Dim> factor = 2 * lame.mu * stretch.change.array() / (1 + stretch.change.array());
    return strain.F * stretch.direction * factor.asDiagonal() * stretch.direction.transpose() + of_volume;
  }
  const auto svd = singular_values(strain.F);
  return 2 * lame.mu * (strain.F - svd.U * svd.V.transpose()) + of_volume;
}

/// W = mu (a - 2 t + d) + lambda/2 (J - 1)^2.
template <int Dim>
InvariantDerivatives fixed_corotated_derivatives(const Vec<Dim>& s, const LameParameters& lame) {
  using I = InvariantDerivatives;
  I W;
  W.first[I::a] = lame.mu;
  W.first[I::t] = -2 * lame.mu;
  W.first[I::J] = lame.lambda * (s.prod() - 1);
  W.second(I::J, I::J) = lame.lambda;
  return W;
}

#define ITR_INSTANTIATE(Dim)                                                             \
  template double fixed_corotated_density<Dim>(const Mat<Dim>&, const LameParameters&);  \
  template Mat<Dim> fixed_corotated_stress<Dim>(const Mat<Dim>&, const LameParameters&); \
  template InvariantDerivatives fixed_corotated_derivatives<Dim>(const Vec<Dim>&, const LameParameters&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
