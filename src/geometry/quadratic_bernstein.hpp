// SPDX-License-Identifier: MIT
// Bernstein coefficients of the Jacobian determinant of a quadratic simplex, at rest or in motion, in any number type. The
// Jacobian matrix J is linear in the barycentric coordinates and (in motion) in time, so a part of the simplex times a part
// of the time is given by J at its corners, and a coefficient is a mean of determinants whose columns come from corners.
#pragma once

#include <array>
#include <vector>

#include "geometry/quadratic_validity.hpp"

namespace itr {

template <typename Number, int Dim>
using Jacobian = std::array<std::array<Number, Dim>, Dim>;  ///< columns

/// J at the corners of a simplex, at one time or at two.
template <typename Number, int Dim, int Times>
using JacobianCorners = std::array<std::array<Jacobian<Number, Dim>, Dim + 1>, Times>;

template <typename Number>
Number determinant(const std::array<Number, 2>& a, const std::array<Number, 2>& b) {
  return a[0] * b[1] - a[1] * b[0];
}
template <typename Number>
Number determinant(const std::array<Number, 3>& a, const std::array<Number, 3>& b, const std::array<Number, 3>& c) {
  return a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0]);
}

/// The determinants that coefficients are means of: where each column comes from.
template <int Dim, int Times>
struct BernsteinTable {
  struct Source {
    int time, corner;
  };
  struct Coefficient {
    std::vector<std::array<Source, Dim>> terms;
    bool is_value = false;  ///< of the determinant at a corner
  };
  std::vector<Coefficient> coefficients;

  BernsteinTable() {
    constexpr int kPlaces = Dim + 1, kAll = Times == 2 ? 1 << Dim : 1;
    int combinations = 1;
    for (int i = 0; i < Dim; ++i) combinations *= kPlaces;
    std::vector<std::array<int, kPlaces + 1>> keys;  // how often each corner, and the later time, is taken
    for (int combination = 0; combination < combinations; ++combination)
      for (int later = 0; later < kAll; ++later) {
        std::array<Source, Dim> term;
        std::array<int, kPlaces + 1> key{};
        for (int i = 0, rest = combination; i < Dim; ++i, rest /= kPlaces) {
          term[i] = {later >> i & 1, rest % kPlaces};
          ++key[term[i].corner];
          key[kPlaces] += term[i].time;
        }
        std::size_t k = 0;
        while (k < keys.size() && keys[k] != key) ++k;
        if (k == keys.size()) {
          keys.push_back(key);
          coefficients.emplace_back();
          bool one_corner = false;
          for (int v = 0; v < kPlaces; ++v) one_corner = one_corner || key[v] == Dim;
          coefficients[k].is_value = one_corner && (key[kPlaces] == 0 || key[kPlaces] == Dim);
        }
        coefficients[k].terms.push_back(term);
      }
  }
  static const BernsteinTable& get() {
    static const BernsteinTable table;
    return table;
  }
};

/// Sum of the determinants of a coefficient: the coefficient times their number.
template <typename Number, int Dim, int Times>
Number coefficient_sum(const typename BernsteinTable<Dim, Times>::Coefficient& coefficient,
                       const JacobianCorners<Number, Dim, Times>& corners) {
  Number sum = 0;
  for (const auto& term : coefficient.terms) {
    const auto column = [&](int i) -> const auto& { return corners[term[i].time][term[i].corner][i]; };
    if constexpr (Dim == 2)
      sum += determinant(column(0), column(1));
    else
      sum += determinant(column(0), column(1), column(2));
  }
  return sum;
}

/// J at the vertices, from positions relative to the first one.
template <typename Number, int Dim>
std::array<Jacobian<Number, Dim>, Dim + 1> jacobians(const QuadraticCell<Dim>& x) {
  std::array<std::array<Number, Dim>, kQuadraticNodes<Dim>> y;
  for (int n = 0; n < kQuadraticNodes<Dim>; ++n)
    for (int c = 0; c < Dim; ++c) y[n][c] = Number(x(c, n)) - Number(x(c, 0));
  std::array<std::array<int, Dim + 1>, Dim + 1> edge{};
  for (int i = 0, n = Dim + 1; i <= Dim; ++i)
    for (int j = i + 1; j <= Dim; ++j, ++n) edge[i][j] = edge[j][i] = n;
  std::array<Jacobian<Number, Dim>, Dim + 1> result;
  for (int v = 0; v <= Dim; ++v) {
    // By the barycentric coordinate i at the vertex v.
    const auto derivative = [&](int i, int c) -> Number {
      return i == v ? Number(3 * y[v][c]) : Number(4 * y[edge[v][i]][c] - y[i][c]);
    };
    for (int d = 0; d < Dim; ++d)
      for (int c = 0; c < Dim; ++c) result[v][d][c] = derivative(d + 1, c) - derivative(0, c);
  }
  return result;
}

/// Corners of the parts of a uniformly refined simplex as pairs of its own: the middle of two, or one twice.
template <int Dim>
const auto& child_corners() {
  using Corner = std::array<int, 2>;
  if constexpr (Dim == 2) {
    static constexpr std::array<std::array<Corner, 3>, 4> kChildren = {
        {{{{0, 0}, {0, 1}, {0, 2}}}, {{{0, 1}, {1, 1}, {1, 2}}}, {{{0, 2}, {1, 2}, {2, 2}}}, {{{0, 1}, {1, 2}, {0, 2}}}}};
    return kChildren;
  } else {
    static constexpr std::array<std::array<Corner, 4>, 8> kChildren = {{{{{0, 0}, {0, 1}, {0, 2}, {0, 3}}},
                                                                        {{{0, 1}, {1, 1}, {1, 2}, {1, 3}}},
                                                                        {{{0, 2}, {1, 2}, {2, 2}, {2, 3}}},
                                                                        {{{0, 3}, {1, 3}, {2, 3}, {3, 3}}},
                                                                        {{{0, 1}, {1, 2}, {0, 2}, {1, 3}}},
                                                                        {{{0, 1}, {0, 2}, {0, 3}, {1, 3}}},
                                                                        {{{0, 2}, {1, 2}, {2, 3}, {1, 3}}},
                                                                        {{{0, 2}, {2, 3}, {0, 3}, {1, 3}}}}};
    return kChildren;
  }
}

template <typename Number, int Dim>
Jacobian<Number, Dim> between(const Jacobian<Number, Dim>& a, const Jacobian<Number, Dim>& b, const Number& t) {
  Jacobian<Number, Dim> result;
  for (int d = 0; d < Dim; ++d)
    for (int c = 0; c < Dim; ++c) result[d][c] = (1 - t) * a[d][c] + t * b[d][c];
  return result;
}

/// Calls f with each part of the refined simplex until one call returns false; says whether none did. The determinants of
/// J in the parts are those of the whole: J is by the coordinates of the whole throughout.
template <typename Number, int Dim, int Times, typename F>
bool for_each_child(const JacobianCorners<Number, Dim, Times>& corners, const F& f) {
  for (const auto& child : child_corners<Dim>()) {
    JacobianCorners<Number, Dim, Times> part;
    for (int time = 0; time < Times; ++time)
      for (int v = 0; v <= Dim; ++v) {
        const auto [i, j] = child[v];
        part[time][v] = i == j ? corners[time][i] : between<Number, Dim>(corners[time][i], corners[time][j], Number(0.5));
      }
    if (!f(part)) return false;
  }
  return true;
}

/// Whether the determinant is above `error` everywhere. False at once where it is not at a corner, and after `depth`
/// refinements.
template <typename Number, int Dim, int Times>
bool is_above(const JacobianCorners<Number, Dim, Times>& corners, const Number& error, int depth) {
  const auto& table = BernsteinTable<Dim, Times>::get();
  bool is_proven = true;
  for (const auto& coefficient : table.coefficients) {
    if (coefficient_sum<Number, Dim, Times>(coefficient, corners) > error * static_cast<int>(coefficient.terms.size()))
      continue;
    if (coefficient.is_value || depth == 0) return false;
    is_proven = false;
  }
  if (is_proven) return true;
  return for_each_child<Number, Dim, Times>(
      corners, [&](const auto& part) { return is_above<Number, Dim, Times>(part, error, depth - 1); });
}

}  // namespace itr
