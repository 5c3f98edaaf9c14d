// SPDX-License-Identifier: MIT
// Round-off, u = 2^-53: positions relative to the first node and J from them have errors below 32 u Y, Y the largest of
// these; a mean of determinants of columns with entries below m_1, ..., m_d adds at most 138 u m_1 ... m_d, and twenty
// halvings of place and time another 360 u. kUnits = 2048 bounds the sum with room.
#include "geometry/quadratic_validity.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <cmath>
#include <limits>

#include "quadratic_bernstein.hpp"

namespace itr {

namespace {

constexpr double kUnits = 2048 * 0x1p-53;
constexpr int kDepth = 6;        ///< refinements of one configuration
constexpr int kMotionDepth = 5;  ///< of a motion: shorter parts of the time are tried then
constexpr double kLeastStep = 0x1p-40;

template <int Dim>
double largest_offset(const QuadraticCell<Dim>& x) {
  return (x.colwise() - x.col(0)).cwiseAbs().maxCoeff();
}

/// Bound of the round-off in a coefficient; `offset` is the largest distance of a node from the first, by component.
template <int Dim, int Times>
double round_off(const JacobianCorners<double, Dim, Times>& corners, double offset) {
  std::array<double, Dim> most{};
  for (const auto& at_time : corners)
    for (const auto& J : at_time)
      for (int d = 0; d < Dim; ++d)
        for (int c = 0; c < Dim; ++c) most[d] = std::max(most[d], std::abs(J[d][c]));
  double all = 1, others = 0;
  for (int d = 0; d < Dim; ++d) all *= most[d];
  for (int d = 0; d < Dim; ++d) {
    double product = offset;
    for (int e = 0; e < Dim; ++e)
      if (e != d) product *= most[e];
    others += product;
  }
  return kUnits * (all + others);
}

template <int Dim>
double bound_below(const JacobianCorners<double, Dim, 1>& corners, double tolerance, double enough, int depth) {
  double least = std::numeric_limits<double>::infinity(), at_corner = least;
  for (const auto& coefficient : BernsteinTable<Dim, 1>::get().coefficients) {
    const double value =
        coefficient_sum<double, Dim, 1>(coefficient, corners) / static_cast<double>(coefficient.terms.size());
    least = std::min(least, value);
    if (coefficient.is_value) at_corner = std::min(at_corner, value);
  }
  if (depth == 0 || least >= enough || at_corner - least <= tolerance * std::abs(at_corner)) return least;
  const bool has_enough = enough < std::numeric_limits<double>::infinity();
  if (has_enough && at_corner < enough) return at_corner;
  double bound = at_corner;
  for_each_child<double, Dim, 1>(corners, [&](const auto& part) {
    bound = std::min(bound, bound_below<Dim>(part, tolerance, enough, depth - 1));
    return true;
  });
  return bound;
}

template <int Dim>
Mat<Dim> as_matrix(const Jacobian<double, Dim>& J) {
  Mat<Dim> result;
  for (int d = 0; d < Dim; ++d)
    for (int c = 0; c < Dim; ++c) result(c, d) = J[d][c];
  return result;
}

/// A cheap proof for what moves little: J = J0 (I + E), and det (I + E) > 0 while |E| < 1. E is linear in place and in time,
/// so that its norm is largest at a corner.
template <int Dim>
bool varies_little(const JacobianCorners<double, Dim, 2>& step, double offset) {
  constexpr double kMost = 0.9, kMostRoundOff = 0.01;
  Mat<Dim> middle = Mat<Dim>::Zero();
  for (const auto& J : step[0]) middle += as_matrix<Dim>(J) / (Dim + 1);
  if (!(middle.determinant() > 0)) return false;
  const Mat<Dim> inverse = middle.inverse();
  if (!(inverse.norm() * offset * kUnits < kMostRoundOff)) return false;
  for (const auto& at_time : step)
    for (const auto& J : at_time)
      if (!((inverse * (as_matrix<Dim>(J) - middle)).squaredNorm() < kMost * kMost)) return false;
  return true;
}

}  // namespace

template <int Dim>
bool is_positive_everywhere(const QuadraticCell<Dim>& x) {
  const JacobianCorners<double, Dim, 1> corners{jacobians<double, Dim>(x)};
  return is_above<double, Dim, 1>(corners, round_off<Dim, 1>(corners, largest_offset<Dim>(x)), kDepth);
}

template <int Dim>
double min_jacobian_bound(const QuadraticCell<Dim>& x, double relative_tolerance, double enough) {
  const JacobianCorners<double, Dim, 1> corners{jacobians<double, Dim>(x)};
  const double error = round_off<Dim, 1>(corners, largest_offset<Dim>(x));
  return bound_below<Dim>(corners, relative_tolerance, enough + error, kDepth) - error;
}

template <int Dim>
bool varies_little(const QuadraticCell<Dim>& x, double most) {
  const auto corners = jacobians<double, Dim>(x);
  Mat<Dim> middle = Mat<Dim>::Zero();
  for (const auto& J : corners) middle += as_matrix<Dim>(J) / (Dim + 1);
  if (!(middle.determinant() > 0)) return false;
  const Mat<Dim> inverse = middle.inverse();
  return std::all_of(corners.begin(), corners.end(),
                     [&](const auto& J) { return (inverse * (as_matrix<Dim>(J) - middle)).squaredNorm() < most * most; });
}

template <int Dim>
double max_positive_step(const QuadraticCell<Dim>& x, const QuadraticCell<Dim>& dx, double tolerance) {
  const QuadraticCell<Dim> end = x + dx;
  const JacobianCorners<double, Dim, 2> step{jacobians<double, Dim>(x), jacobians<double, Dim>(end)};
  const double offset = std::max(largest_offset<Dim>(x), largest_offset<Dim>(end));
  if (varies_little<Dim>(step, offset)) return 1;
  const double error = round_off<Dim, 2>(step, offset);
  const auto is_free = [&](double from, double to) {
    JacobianCorners<double, Dim, 2> part;
    for (int v = 0; v <= Dim; ++v) {
      part[0][v] = between<double, Dim>(step[0][v], step[1][v], from);
      part[1][v] = between<double, Dim>(step[0][v], step[1][v], to);
    }
    return is_above<double, Dim, 2>(part, error, kMotionDepth);
  };
  double proven = 0;
  for (double length = 1; length > std::max(kLeastStep, tolerance * proven);) {
    if (proven + length > 1) length = 1 - proven;
    if (is_free(proven, proven + length)) {
      proven += length;
      if (proven >= 1) return 1;
    } else {
      length /= 2;
    }
  }
  return proven;
}

#define ITR_INSTANTIATE(Dim)                                                          \
  template bool is_positive_everywhere<Dim>(const QuadraticCell<Dim>&);               \
  template double min_jacobian_bound<Dim>(const QuadraticCell<Dim>&, double, double); \
  template bool varies_little<Dim>(const QuadraticCell<Dim>&, double);                \
  template double max_positive_step<Dim>(const QuadraticCell<Dim>&, const QuadraticCell<Dim>&, double);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
