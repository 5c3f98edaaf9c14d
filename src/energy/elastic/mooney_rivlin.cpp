// SPDX-License-Identifier: MIT
// With p = 2/d: I1 = J^-p a, I2 = J^-2p (a^2 - q) / 2. In 2D I2 is 1 whatever F.
#include <Eigen/LU>
#include <cmath>

#include "isotropic.hpp"
#include "strain.hpp"

namespace itr {

namespace {

template <int Dim>
struct Isochoric {
  double I1, I2;
  Isochoric(double a, double q, double J) {
    const double scale = std::pow(J, -2.0 / Dim);
    I1 = scale * a;
    I2 = Dim == 2 ? 1 : 0.5 * scale * scale * (a * a - q);
  }
};

/// I2 - d of the undeformed state.
template <int Dim>
constexpr double kRestI2 = Dim == 2 ? -1 : 0;

template <int Dim>
InvariantDerivatives derivatives(double a, double q, double J, const MooneyRivlinModuli& m) {
  using I = InvariantDerivatives;
  constexpr double p = 2.0 / Dim;
  const Isochoric<Dim> iso(a, q, J);
  const double scale = std::pow(J, -p);
  Vec<4> g1 = Vec<4>::Zero(), g2 = Vec<4>::Zero();
  Mat<4> H1 = Mat<4>::Zero(), H2 = Mat<4>::Zero();
  g1[I::a] = scale;
  g1[I::J] = -p * iso.I1 / J;
  H1(I::a, I::J) = H1(I::J, I::a) = -p * scale / J;
  H1(I::J, I::J) = p * (p + 1) * iso.I1 / (J * J);
  if (Dim == 3) {
    g2[I::a] = scale * scale * a;
    g2[I::q] = -0.5 * scale * scale;
    g2[I::J] = -2 * p * iso.I2 / J;
    H2(I::a, I::a) = scale * scale;
    H2(I::a, I::J) = H2(I::J, I::a) = -2 * p * scale * scale * a / J;
    H2(I::q, I::J) = H2(I::J, I::q) = p * scale * scale / J;
    H2(I::J, I::J) = 2 * p * (2 * p + 1) * iso.I2 / (J * J);
  }
  const double by_I1 = m.c1 + m.c3 * (iso.I2 - Dim), by_I2 = m.c2 + m.c3 * (iso.I1 - Dim), log_J = std::log(J);
  I W;
  W.first = by_I1 * g1 + by_I2 * g2;
  W.first[I::J] += m.log_k * log_J / J + 2 * m.volume_d * (J - 1);
  W.second = by_I1 * H1 + by_I2 * H2 + m.c3 * (g1 * g2.transpose() + g2 * g1.transpose());
  W.second(I::J, I::J) += m.log_k * (1 - log_J) / (J * J) + 2 * m.volume_d;
  return W;
}

}  // namespace

namespace {

/// I1 - d and I2 - d in which nothing cancels, with t = tr(C - I), m = (t^2 - |C - I|^2) / 2 and l = ln J:
/// I1 - d = (t - 2 l) + d r(-p l) + e t and I2 - 3 = 2 (t - 2 l) + 3 r(-2 p l) + m + e2 (2 t + m), where
/// r(y) = exp(y) - 1 - y, e = exp(-p l) - 1 and e2 = exp(-2 p l) - 1.
template <int Dim>
struct IsochoricChange {
  double t, m, scale, I1, I2;  ///< scale: J^-p; I2 is 0 in 2D

  explicit IsochoricChange(const Strain<Dim>& strain)
      : t(strain.A.trace()), m(Dim == 2 ? 0 : (t * t - strain.A.squaredNorm()) / 2) {
    const double y = -2.0 / Dim * strain.log_J, e = std::expm1(y), e2 = std::expm1(2 * y);
    const double second = strain.trace_minus_log();
    scale = 1 + e;
    I1 = second + Dim * minus_expm1(y) + e * t;
    I2 = Dim == 2 ? 0 : 2 * second + 3 * minus_expm1(2 * y) + m + e2 * (2 * t + m);
  }
};

}  // namespace

template <int Dim>
double mooney_rivlin_density(const Mat<Dim>& G, const MooneyRivlinModuli& moduli) {
  const Strain<Dim> strain(G);
  const IsochoricChange<Dim> change(strain);
  return (moduli.c1 + moduli.c3 * (change.I2 + kRestI2<Dim>)) * change.I1 + moduli.c2 * change.I2 +
         moduli.log_k / 2 * strain.log_J * strain.log_J + moduli.volume_d * strain.J_minus_1 * strain.J_minus_1;
}

/// F^-T times a symmetric matrix that vanishes at rest: 2 W_1 J^-p (A - t/d) + 2 W_2 J^-2p ((1 + t) A - A^2 - (t + 2 m)/3) +
/// k ln J + 2 D (J - 1) J with A = C - I.
template <int Dim>
Mat<Dim> mooney_rivlin_stress(const Mat<Dim>& G, const MooneyRivlinModuli& moduli) {
  const Strain<Dim> strain(G);
  const IsochoricChange<Dim> change(strain);
  const double by_I1 = moduli.c1 + moduli.c3 * (change.I2 + kRestI2<Dim>), by_I2 = moduli.c2 + moduli.c3 * change.I1;
  const Mat<Dim>& A = strain.A;
  const Mat<Dim> I = Mat<Dim>::Identity();
  Mat<Dim> inner = 2 * by_I1 * change.scale * (A - change.t / Dim * I);
  if (Dim == 3)
    inner += 2 * by_I2 * change.scale * change.scale * ((1 + change.t) * A - A * A - (change.t + 2 * change.m) / 3 * I);
  inner += (moduli.log_k * strain.log_J + 2 * moduli.volume_d * strain.J_minus_1 * strain.J()) * I;
  return strain.inverse_transpose() * inner;
}

template <int Dim>
InvariantDerivatives mooney_rivlin_derivatives(const Vec<Dim>& s, const MooneyRivlinModuli& m) {
  return derivatives<Dim>(s.squaredNorm(), s.array().square().square().sum(), s.prod(), m);
}

#define ITR_INSTANTIATE(Dim)                                                               \
  template double mooney_rivlin_density<Dim>(const Mat<Dim>&, const MooneyRivlinModuli&);  \
  template Mat<Dim> mooney_rivlin_stress<Dim>(const Mat<Dim>&, const MooneyRivlinModuli&); \
  template InvariantDerivatives mooney_rivlin_derivatives<Dim>(const Vec<Dim>&, const MooneyRivlinModuli&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
