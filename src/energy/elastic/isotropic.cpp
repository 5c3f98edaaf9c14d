// SPDX-License-Identifier: MIT
#include "isotropic.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>

namespace itr {

SingularValues<2> singular_values(const Mat<2>& F) {
  const double e = (F(0, 0) + F(1, 1)) / 2, f = (F(0, 0) - F(1, 1)) / 2;
  const double g = (F(1, 0) + F(0, 1)) / 2, h = (F(1, 0) - F(0, 1)) / 2;
  const double q = std::hypot(e, h), r = std::hypot(f, g);
  const double a1 = std::atan2(g, f), a2 = std::atan2(h, e);
  const double phi = (a2 + a1) / 2, theta = (a2 - a1) / 2;
  const double cp = std::cos(phi), sp = std::sin(phi), ct = std::cos(theta), st = std::sin(theta);
  SingularValues<2> result;
  result.U << cp, -sp, sp, cp;
  result.V << ct, st, -st, ct;
  result.s << q + r, F.determinant() / (q + r);  // the quotient keeps a small singular value accurate
  return result;
}

SingularValues<3> singular_values(const Mat<3>& F) {
  // V from F^T F, then F V = U diag(s): the two large columns give U, which keeps it a rotation to round-off, and the
  // determinant gives the small singular value, which the squares in F^T F would lose.
  const Eigen::SelfAdjointEigenSolver<Mat<3>> squares(Mat<3>(F.transpose() * F));
  SingularValues<3> result;
  result.V = squares.eigenvectors().rowwise().reverse();
  if (result.V.determinant() < 0) result.V.col(2) = -result.V.col(2);
  Vec<3> first = F * result.V.col(0), second = F * result.V.col(1);
  result.s[0] = first.norm();
  first /= result.s[0];
  second -= first.dot(second) * first;
  result.s[1] = second.norm();
  second /= result.s[1];
  result.s[2] = F.determinant() / (result.s[0] * result.s[1]);
  result.U << first, second, first.cross(second);
  return result;
}

template <int Dim>
EigenSystem<Dim> eigensystem_of(const SingularValues<Dim>& svd, const StretchStiffness<Dim>& stiffness) {
  const auto& [U, V, s] = svd;
  const Eigen::SelfAdjointEigenSolver<Mat<Dim>> solver(stiffness.scaling);
  EigenSystem<Dim> system;
  int k = 0;
  for (; k < Dim; ++k) {
    system.values[k] = solver.eigenvalues()[k];
    system.modes[k] = U * solver.eigenvectors().col(k).asDiagonal() * V.transpose();
  }
  const double half = std::sqrt(0.5);
  for (int i = 0, pair = 0; i < Dim; ++i)
    for (int j = i + 1; j < Dim; ++j, ++pair) {
      const Mat<Dim> first = half * U.col(i) * V.col(j).transpose(), second = half * U.col(j) * V.col(i).transpose();
      system.values[k] = stiffness.symmetric[pair];
      system.modes[k++] = first + second;
      system.values[k] = stiffness.skew[pair];
      system.modes[k++] = first - second;
    }
  return system;
}

template <int Dim>
EigenSystem<Dim> isotropic_eigensystem(const SingularValues<Dim>& svd, const InvariantDerivatives& W) {
  const auto& s = svd.s;
  const double J = s.prod();
  Eigen::Matrix<double, Dim, 4> slope;  // of the invariants by s_i
  for (int i = 0; i < Dim; ++i) slope.row(i) << 2 * s[i], 4 * s[i] * s[i] * s[i], 1, J / s[i];
  const double W_a = W.first[InvariantDerivatives::a], W_q = W.first[InvariantDerivatives::q];
  const double W_t = W.first[InvariantDerivatives::t], W_J = W.first[InvariantDerivatives::J];
  Mat<Dim> scaling = slope * W.second * slope.transpose();
  for (int i = 0; i < Dim; ++i)
    for (int j = 0; j < Dim; ++j) scaling(i, j) += i == j ? 2 * W_a + 12 * s[i] * s[i] * W_q : W_J * J / (s[i] * s[j]);
  StretchStiffness<Dim> stiffness{scaling, {}, {}};
  for (int i = 0, pair = 0; i < Dim; ++i)
    for (int j = i + 1; j < Dim; ++j, ++pair) {
      const double squares = s[i] * s[i] + s[j] * s[j], product = s[i] * s[j], rest = W_J * J / product;
      // (W_i - W_j) / (s_i - s_j) and (W_i + W_j) / (s_i + s_j), with the division carried out.
      stiffness.symmetric[pair] = 2 * W_a + 4 * W_q * (squares + product) - rest;
      stiffness.skew[pair] = 2 * W_a + 4 * W_q * (squares - product) + rest + 2 * W_t / (s[i] + s[j]);
    }
  return eigensystem_of<Dim>(svd, stiffness);
}

template EigenSystem<2> eigensystem_of(const SingularValues<2>&, const StretchStiffness<2>&);
template EigenSystem<3> eigensystem_of(const SingularValues<3>&, const StretchStiffness<3>&);
template EigenSystem<2> isotropic_eigensystem(const SingularValues<2>&, const InvariantDerivatives&);
template EigenSystem<3> isotropic_eigensystem(const SingularValues<3>&, const InvariantDerivatives&);

}  // namespace itr
