// SPDX-License-Identifier: MIT
// Measures of strain from the displacement gradient G = F - I that keep their relative precision at small strains, where
// F^T F - I, det F - 1 and ln det F would cancel.
#pragma once

#include <Eigen/LU>
#include <cmath>

#include "itr/types.hpp"

namespace itr {

/// C - I = G + G^T + G^T G with C = F^T F: twice Green's strain.
template <int Dim>
Mat<Dim> twice_green_strain(const Mat<Dim>& G) {
  Mat<Dim> A = G.transpose() * G;
  A += G + G.transpose();
  return A;
}

/// The sum of the principal minors of order two and more: det(I + A) = 1 + tr A + sum_of_minors(A).
inline double sum_of_minors(const Mat<2>& A) { return A(0, 0) * A(1, 1) - A(0, 1) * A(1, 0); }
inline double sum_of_minors(const Mat<3>& A) {
  return A(0, 0) * A(1, 1) - A(0, 1) * A(1, 0) + A(0, 0) * A(2, 2) - A(0, 2) * A(2, 0) + A(1, 1) * A(2, 2) -
         A(1, 2) * A(2, 1) + A.determinant();
}

/// x - ln(1 + x), which is x^2/2 for small x.
inline double minus_log1p(double x) {
  constexpr double kSeries = 1.0 / 16;  ///< where 14 terms reach round-off, and the difference loses one digit
  constexpr int kTerms = 14;
  if (!(std::abs(x) < kSeries)) return x - std::log1p(x);
  double sum = 0;
  for (int k = kTerms + 1; k >= 2; --k) sum = 1.0 / k - x * sum;
  return x * x * sum;
}

/// exp(x) - 1 - x, which is x^2/2 for small x.
inline double minus_expm1(double x) {
  constexpr double kSeries = 1.0 / 4;
  constexpr int kTerms = 12;
  if (!(std::abs(x) < kSeries)) return std::expm1(x) - x;
  double sum = 0;
  for (int k = kTerms + 2; k > 2; --k) sum = (1 + sum) * x / k;
  return x * x / 2 * (1 + sum);
}

/// A displacement gradient with the measures that densities are made of.
template <int Dim>
struct Strain {
  Mat<Dim> F;
  Mat<Dim> A;        ///< C - I
  double J_minus_1;  ///< from G itself, precise where J is small, too
  double log_J;      ///< not finite where J <= 0
  bool is_small;     ///< below which differences of first order would cancel

  explicit Strain(const Mat<Dim>& G)
      : F(G + Mat<Dim>::Identity()),
        A(twice_green_strain<Dim>(G)),
        J_minus_1(G.trace() + sum_of_minors(G)),
        log_J(std::log1p(J_minus_1)),
        is_small(A.template lpNorm<Eigen::Infinity>() < kSmall) {}

  double J() const { return 1 + J_minus_1; }
  /// tr(C - I) - 2 ln J, of second order in the strain.
  double trace_minus_log() const {
    const double minors = sum_of_minors(A);
    return is_small ? minus_log1p(A.trace() + minors) - minors : A.trace() - 2 * log_J;
  }
  Mat<Dim> inverse_transpose() const { return F.inverse().transpose(); }

 private:
  static constexpr double kSmall = 0.25;
};

}  // namespace itr
