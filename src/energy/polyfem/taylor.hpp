// SPDX-License-Identifier: MIT
// Numbers that carry their derivatives, for energies of few variables.
#pragma once

#include <array>
#include <cmath>

#include "itr/types.hpp"

namespace itr {

/// A function of N variables at one point: value, gradient and Hessian.
template <int N>
struct Taylor {
  double value = 0;
  Vec<N> first = Vec<N>::Zero();
  Mat<N> second = Mat<N>::Zero();

  Taylor() = default;
  Taylor(double constant) : value(constant) {}
  static Taylor variable(double value, int index) {
    Taylor x(value);
    x.first[index] = 1;
    return x;
  }
  /// f of this, by f and its first two derivatives there.
  Taylor chain(const std::array<double, 3>& f) const {
    Taylor y(f[0]);
    y.first = f[1] * first;
    y.second = f[1] * second + f[2] * first * first.transpose();
    return y;
  }

  friend Taylor operator+(Taylor a, const Taylor& b) {
    a.value += b.value;
    a.first += b.first;
    a.second += b.second;
    return a;
  }
  friend Taylor operator-(Taylor a, const Taylor& b) { return a + b * -1.0; }
  friend Taylor operator*(Taylor a, double b) {
    a.value *= b;
    a.first *= b;
    a.second *= b;
    return a;
  }
  friend Taylor operator*(const Taylor& a, const Taylor& b) {
    Taylor y(a.value * b.value);
    y.first = a.value * b.first + b.value * a.first;
    y.second = a.value * b.second + b.value * a.second;
    const Mat<N> mixed = a.first * b.first.transpose();
    y.second += mixed + mixed.transpose();
    return y;
  }
  friend Taylor operator/(const Taylor& a, const Taylor& b) {
    const double r = 1 / b.value;
    return a * b.chain({r, -r * r, 2 * r * r * r});
  }
};

inline double value_of(double x) { return x; }
template <int N>
double value_of(const Taylor<N>& x) {
  return x.value;
}
inline double chain(double, const std::array<double, 3>& f) { return f[0]; }
template <int N>
Taylor<N> chain(const Taylor<N>& x, const std::array<double, 3>& f) {
  return x.chain(f);
}
template <typename T>
T root(const T& x) {
  const double r = std::sqrt(value_of(x));
  return chain(x, {r, 0.5 / r, -0.25 / (r * r * r)});
}

}  // namespace itr
