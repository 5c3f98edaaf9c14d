// SPDX-License-Identifier: MIT
// With p = 2/d: I1 = J^-p a, I2 = J^-2p (a^2 - q) / 2. In 2D I2 is 1 whatever F.
#include <Eigen/LU>
#include <cmath>

#include "isotropic.hpp"

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

template <int Dim>
double mooney_rivlin_density(const Mat<Dim>& F, const MooneyRivlinModuli& m) {
  const Mat<Dim> C = F.transpose() * F;
  const double J = F.determinant(), log_J = std::log(J);
  const Isochoric<Dim> iso(C.trace(), C.squaredNorm(), J);
  return (m.c1 + m.c3 * (iso.I2 - Dim)) * (iso.I1 - Dim) + m.c2 * (iso.I2 - Dim - kRestI2<Dim>)+m.log_k / 2 * log_J * log_J +
         m.volume_d * (J - 1) * (J - 1);
}

template <int Dim>
Mat<Dim> mooney_rivlin_stress(const Mat<Dim>& F, const MooneyRivlinModuli& m) {
  using I = InvariantDerivatives;
  const Mat<Dim> C = F.transpose() * F;
  const double J = F.determinant();
  const Vec<4> W = derivatives<Dim>(C.trace(), C.squaredNorm(), J, m).first;
  return 2 * W[I::a] * F + 4 * W[I::q] * F * C + W[I::J] * J * F.inverse().transpose();
}

template <int Dim>
InvariantDerivatives mooney_rivlin_derivatives(const Vec<Dim>& s, const MooneyRivlinModuli& m) {
  return derivatives<Dim>(s.squaredNorm(), s.array().square().square().sum(), s.prod(), m);
}

#define ITR_INSTANTIATE(Dim)                                                               \
  template double mooney_rivlin_density<Dim>(const Mat<Dim>&, const MooneyRivlinModuli&);  \
  template Mat<Dim> mooney_rivlin_stress<Dim>(const Mat<Dim>&, const MooneyRivlinModuli&); \
  template InvariantDerivatives mooney_rivlin_derivatives<Dim>(const Vec<Dim>&, const MooneyRivlinModuli&);
ITR_INSTANTIATE(2)
ITR_INSTANTIATE(3)
#undef ITR_INSTANTIATE

}  // namespace itr
