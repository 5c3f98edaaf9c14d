// SPDX-License-Identifier: MIT
// Proofs about quadratic curves (2D) and triangles (3D) by their Bernstein coefficients: a patch lies in the hull of its
// control points, and those of its parts close in on it.
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <limits>

#include "geometry/predicates.hpp"
#include "itr/types.hpp"

namespace itr {

/// Control points: `at[i][i]` at the corner i, `at[i][j] = at[j][i]` of the edge between two.
template <int Dim>
struct QuadraticPatch {
  std::array<std::array<Vec<Dim>, Dim>, Dim> at;
};

/// `middle(i, j)`: the point halfway along the edge from the corner i to j.
template <int Dim, typename Middle>
QuadraticPatch<Dim> quadratic_patch(const std::array<Vec<Dim>, Dim>& corners, const Middle& middle) {
  QuadraticPatch<Dim> patch;
  for (int i = 0; i < Dim; ++i) {
    patch.at[i][i] = corners[i];
    for (int j = i + 1; j < Dim; ++j)
      patch.at[i][j] = patch.at[j][i] = 2 * Vec<Dim>(middle(i, j)) - (corners[i] + corners[j]) / 2;
  }
  return patch;
}

/// Parts with half of the edges' parameters.
template <int Dim>
auto parts_of(const QuadraticPatch<Dim>& patch) {
  using Corner = std::array<int, 2>;  // the middle of two corners, or one twice
  constexpr int kParts = Dim == 2 ? 2 : 4;
  std::array<std::array<Corner, Dim>, kParts> corners;
  if constexpr (Dim == 2)
    corners = {{{{{0, 0}, {0, 1}}}, {{{0, 1}, {1, 1}}}}};
  else
    corners = {
        {{{{0, 0}, {0, 1}, {0, 2}}}, {{{0, 1}, {1, 1}, {1, 2}}}, {{{0, 2}, {1, 2}, {2, 2}}}, {{{0, 1}, {1, 2}, {0, 2}}}}};
  std::array<QuadraticPatch<Dim>, kParts> parts;
  for (int p = 0; p < kParts; ++p)
    for (int i = 0; i < Dim; ++i)
      for (int j = 0; j < Dim; ++j) {
        const auto [a, b] = corners[p][i];
        const auto [c, d] = corners[p][j];
        parts[p].at[i][j] = ((patch.at[a][c] + patch.at[b][d]) + (patch.at[a][d] + patch.at[b][c])) / 4;
      }
  return parts;
}

template <int Dim>
double extent(const QuadraticPatch<Dim>& patch) {
  double result = 0;
  for (const auto& row : patch.at)
    for (const Vec<Dim>& p : row) result = std::max(result, (p - patch.at[0][0]).cwiseAbs().maxCoeff());
  return result;
}

/// Whether all control points of `a` are on one side of all of `b` along `axis`, by more than round-off.
template <int Dim>
bool is_separating(const Vec<Dim>& axis, const QuadraticPatch<Dim>& a, const QuadraticPatch<Dim>& b) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const Vec<Dim>& origin = a.at[0][0];
  double low_a = kInfinity, high_a = -kInfinity, low_b = kInfinity, high_b = -kInfinity, size = 0;
  for (int i = 0; i < Dim; ++i)
    for (int j = i; j < Dim; ++j) {
      const double in_a = axis.dot(a.at[i][j] - origin), in_b = axis.dot(b.at[i][j] - origin);
      low_a = std::min(low_a, in_a), high_a = std::max(high_a, in_a);
      low_b = std::min(low_b, in_b), high_b = std::max(high_b, in_b);
      size = std::max({size, a.at[i][j].norm(), b.at[i][j].norm()});
    }
  return std::max(low_b - high_a, low_a - high_b) > 16 * std::numeric_limits<double>::epsilon() * size * axis.norm();
}

inline bool have_separating_axis(const QuadraticPatch<2>& a, const QuadraticPatch<2>& b) {
  const auto is_normal_separating = [&](const Vec<2>& d) { return is_separating<2>({-d[1], d[0]}, a, b); };
  for (const auto* p : {&a, &b})
    if (is_normal_separating(p->at[1][1] - p->at[0][0]) || is_normal_separating(p->at[0][1] - p->at[0][0]) ||
        is_normal_separating(p->at[1][1] - p->at[0][1]))
      return true;
  return is_separating<2>(b.at[0][1] - a.at[0][1], a, b);
}

inline bool have_separating_axis(const QuadraticPatch<3>& a, const QuadraticPatch<3>& b) {
  const auto edge = [](const QuadraticPatch<3>& p, int i) -> Vec<3> { return p.at[(i + 1) % 3][(i + 1) % 3] - p.at[i][i]; };
  const auto normal = [&](const QuadraticPatch<3>& p) -> Vec<3> { return edge(p, 0).cross(edge(p, 1)); };
  const auto middle = [](const QuadraticPatch<3>& p) -> Vec<3> { return (p.at[0][1] + p.at[1][2] + p.at[0][2]) / 3; };
  if (is_separating<3>(normal(a), a, b) || is_separating<3>(normal(b), a, b) ||
      is_separating<3>(middle(b) - middle(a), a, b))
    return true;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      if (is_separating<3>(edge(a, i).cross(edge(b, j)), a, b)) return true;
  for (const auto* p : {&a, &b})  // within the planes of the patches, where both are flat
    for (int i = 0; i < 3; ++i)
      if (is_separating<3>(normal(*p).cross(edge(*p, i)), a, b)) return true;
  return false;
}

/// Proves that two patches have no common point. False where they have one, and where `depth` halvings are too few.
template <int Dim>
bool are_apart(const QuadraticPatch<Dim>& a, const QuadraticPatch<Dim>& b, int depth = 48) {
  if (have_separating_axis(a, b)) return true;
  if (depth == 0) return false;
  if (extent(a) < extent(b)) return are_apart(b, a, depth);
  const auto parts = parts_of(a);
  return std::all_of(parts.begin(), parts.end(), [&](const auto& part) { return are_apart(part, b, depth - 1); });
}

/// Whether a point is between a curve and the chord of its ends, or too near to the curve to tell.
inline bool is_beyond_chord(const QuadraticPatch<2>& curve, const Vec<2>& p, int depth = 48) {
  const auto is_in = [&](const Vec<2>& a, const Vec<2>& b, const Vec<2>& c) {
    const int s = orientation(a, b, p), t = orientation(b, c, p), u = orientation(c, a, p);
    return (s >= 0 && t >= 0 && u >= 0) || (s <= 0 && t <= 0 && u <= 0);
  };
  const Vec<2>&a = curve.at[0][0], &b = curve.at[1][1];
  if (orientation(a, curve.at[0][1], b) == 0 || !is_in(a, curve.at[0][1], b)) return false;
  const auto parts = parts_of(curve);
  if (depth == 0 || is_in(a, parts[0].at[1][1], b)) return true;
  return is_beyond_chord(parts[0], p, depth - 1) || is_beyond_chord(parts[1], p, depth - 1);
}

}  // namespace itr
