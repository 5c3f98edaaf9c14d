// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <random>

#include "itr/types.hpp"

namespace itr {

/// A point with coordinates in (-scale, scale).
template <int Dim>
Vec<Dim> random_point(std::mt19937& random, double scale = 1) {
  std::uniform_real_distribution<double> coordinate(-scale, scale);
  return Vec<Dim>::NullaryExpr([&] { return coordinate(random); });
}

/// The vertices of a pair of primitives.
template <int Dim>
std::array<Vec<Dim>, 4> random_pair(std::mt19937& random) {
  return {random_point<Dim>(random), random_point<Dim>(random), random_point<Dim>(random), random_point<Dim>(random)};
}

}  // namespace itr
