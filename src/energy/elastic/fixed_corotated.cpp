// SPDX-License-Identifier: MIT
#include <Eigen/LU>

#include "isotropic.hpp"

namespace itr {

template <int Dim>
double fixed_corotated_density(const Mat<Dim>& F, const LameParameters& lame) {
  const double off = F.determinant() - 1;
  return lame.mu * (singular_values(F).s.array() - 1).square().sum() + lame.lambda / 2 * off * off;
}

/// 2 mu (F - R) + lambda (J - 1) cof F.
template <int Dim>
Mat<Dim> fixed_corotated_stress(const Mat<Dim>& F, const LameParameters& lame) {
  const auto svd = singular_values(F);
  const double J = F.determinant();
  return 2 * lame.mu * (F - svd.U * svd.V.transpose()) + lame.lambda * (J - 1) * J * F.inverse().transpose();
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
ITR_INSTANTIATE(2)
ITR_INSTANTIATE(3)
#undef ITR_INSTANTIATE

}  // namespace itr
