// SPDX-License-Identifier: MIT
// Smooth curves through the vertices of a surface in 2D: quadratic B-splines with control points that make them nearly
// interpolate (quasi-interpolation), in pieces between the middles of edges; straight where there is a corner.
#pragma once

#include <array>
#include <cmath>
#include <vector>

#include "energy/contact/retraction.hpp"
#include "energy/contact/surface.hpp"
#include "itr/types.hpp"

namespace itr {

/// The root in (low, high) of f, which is negative at low and positive at high, from t on: by Newton's method, halving where
/// it leaves the bracket. f(t) returns value and derivative.
template <typename F>
double bracketed_root(double low, double high, double t, const F& f) {
  constexpr int kMostIterations = 60;
  constexpr double kSame = 1e-15;
  for (int k = 0; k < kMostIterations; ++k) {
    const auto [value, derivative] = f(t);
    if (value == 0) break;
    (value > 0 ? high : low) = t;
    double next = t - value / derivative;
    if (!(next > low && next < high)) next = (low + high) / 2;
    const bool is_same = std::abs(next - t) <= kSame;
    t = next;
    if (is_same) break;
  }
  return t;
}

/// Positions c(t) = sum_i w_i(t) p_i, t in [0, 1], with quadratic weights w_i of vertices.
struct CurvePiece {
  static constexpr int kMost = 5;
  using Weights = Eigen::Matrix<double, kMost, 1>;

  int part = 0;    ///< number of the connected part of the surface
  int vertex = 0;  ///< whose piece it is
  int size = 0;
  std::array<int, kMost> vertices{};
  Eigen::Matrix<double, kMost, 3> coefficients = Eigen::Matrix<double, kMost, 3>::Zero();  ///< of 1, t, t^2
  std::array<int, 3> owners{};   ///< vertices whose hats are not 0 here
  Mat<3> hats = Mat<3>::Zero();  ///< coefficients of these hats, which sum to 1
  double side = 1;               ///< 1 where (t_y, -t_x) of a tangent t is outward, else -1
  double length = 0;             ///< at rest [m]

  static Vec<3> powers(double t) { return {1, t, t * t}; }
  Weights at(double t) const { return coefficients * powers(t); }
  Weights slope(double t) const { return coefficients * Vec<3>(0, 1, 2 * t); }
  Weights bend() const { return coefficients * Vec<3>(0, 0, 2); }
  Vec<2> position(const Weights& weights, ConstVectorView x) const {
    Vec<2> p = Vec<2>::Zero();
    for (int i = 0; i < size; ++i) p += weights[i] * x.segment<2>(2 * vertices[i]);
    return p;
  }
};

/// The pieces of all curves, in the order of the vertices.
std::vector<CurvePiece> curve_pieces(const CollisionSurface& surface, const Retraction& retraction);

/// A piece at some positions: c(t) = c[0] + c[1] t + c[2] t^2.
struct PlacedPiece {
  std::array<Vec<2>, 3> c;
  Vec<2> at(double t) const { return c[0] + t * (c[1] + t * c[2]); }
  Vec<2> tangent(double t) const { return c[1] + 2 * t * c[2]; }
  /// The t in [0, 1] of the point nearest to q.
  double nearest(const Vec<2>& q) const;
};

}  // namespace itr
