// SPDX-License-Identifier: MIT
#include "isotropic.hpp"
#include "strain.hpp"

namespace itr {

template <int Dim>
double saint_venant_density(const Mat<Dim>& G, const LameParameters& lame) {
  const Mat<Dim> E = 0.5 * twice_green_strain<Dim>(G);
  return lame.mu * E.squaredNorm() + lame.lambda / 2 * E.trace() * E.trace();
}

template <int Dim>
Mat<Dim> saint_venant_stress(const Mat<Dim>& G, const LameParameters& lame) {
  const Mat<Dim> E = 0.5 * twice_green_strain<Dim>(G), I = Mat<Dim>::Identity();
  return (I + G) * (2 * lame.mu * E + lame.lambda * E.trace() * I);
}

/// W = mu/4 (q - 2 a + d) + lambda/8 (a - d)^2.
template <int Dim>
InvariantDerivatives saint_venant_derivatives(const Vec<Dim>& s, const LameParameters& lame) {
  using I = InvariantDerivatives;
  I W;
  W.first[I::a] = -lame.mu / 2 + lame.lambda / 4 * (s.squaredNorm() - Dim);
  W.first[I::q] = lame.mu / 4;
  W.second(I::a, I::a) = lame.lambda / 4;
  return W;
}

#define ITR_INSTANTIATE(Dim)                                                          \
  template double saint_venant_density<Dim>(const Mat<Dim>&, const LameParameters&);  \
  template Mat<Dim> saint_venant_stress<Dim>(const Mat<Dim>&, const LameParameters&); \
  template InvariantDerivatives saint_venant_derivatives<Dim>(const Vec<Dim>&, const LameParameters&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
