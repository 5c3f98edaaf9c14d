// SPDX-License-Identifier: MIT
// Random quadratic cells and motions, and the sign of their Jacobians by sampling.
#pragma once

#include <random>

#include "fem/cell_set.hpp"
#include "geometry/quadratic_validity.hpp"

namespace itr {

/// det dx/dxi at barycentric coordinates, by the shape functions.
template <int Dim>
double jacobian_at(const QuadraticCell<Dim>& x, const std::array<double, Dim + 1>& l) {
  const auto linear = barycentric_gradients<Dim>(Mat<Dim>::Identity());
  return (x * quadratic_gradients<Dim, Dim>(kAllCurved<Dim>, l, linear).transpose()).determinant();
}

template <int Dim>
std::array<double, Dim + 1> random_place(std::mt19937& random) {
  std::exponential_distribution<double> part(1);
  std::uniform_int_distribution<int> choice(0, 3);
  std::array<double, Dim + 1> l;
  double sum = 0;
  for (double& value : l) sum += value = choice(random) == 0 ? 0 : part(random);  // often on a face or an edge
  if (sum == 0) l[0] = sum = 1;
  for (double& value : l) value /= sum;
  return l;
}

template <int Dim>
QuadraticCell<Dim> unit_cell() {
  QuadraticCell<Dim> x = QuadraticCell<Dim>::Zero();
  for (int k = 0; k < Dim; ++k) x(k, k + 1) = 1;
  for_each_edge<Dim>([&](int edge, int i, int j) { x.col(Dim + 1 + edge) = (x.col(i) + x.col(j)) / 2; });
  return x;
}

template <int Dim>
QuadraticCell<Dim> random_motion(std::mt19937& random, double amount) {
  std::uniform_real_distribution<double> noise(-amount, amount);
  return QuadraticCell<Dim>::NullaryExpr([&] { return noise(random); });
}

template <int Dim>
double least_sampled(const QuadraticCell<Dim>& x, std::mt19937& random, int samples) {
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i < samples; ++i) least = std::min(least, jacobian_at<Dim>(x, random_place<Dim>(random)));
  return least;
}

}  // namespace itr
