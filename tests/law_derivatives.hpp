// SPDX-License-Identifier: MIT
// Derivatives of material laws as matrices, whose rows and columns are F by columns.
#pragma once

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>

#include "energy/elastic/laws.hpp"

namespace itr {

template <int Dim>
using Flat = Mat<Dim * Dim>;

template <int Dim>
Flat<Dim> matrix_of(const EigenSystem<Dim>& system) {
  Flat<Dim> H = Flat<Dim>::Zero();
  for (std::size_t k = 0; k < system.values.size(); ++k) {
    const Eigen::Map<const Vec<Dim * Dim>> mode(system.modes[k].data());
    H += system.values[k] * mode * mode.transpose();
  }
  return H;
}

/// Central differences of the stress by F.
template <int Dim>
Flat<Dim> differences_of_stress(const Mat<Dim>& F, const ElasticModuli& moduli) {
  constexpr double kStep = 1e-6;
  Flat<Dim> differences;
  for (int k = 0; k < Dim * Dim; ++k) {
    Mat<Dim> plus = F, minus = F;
    plus.data()[k] += kStep;
    minus.data()[k] -= kStep;
    const Mat<Dim> column = (elastic_stress<Dim>(plus, moduli) - elastic_stress<Dim>(minus, moduli)) / (2 * kStep);
    differences.col(k) = Eigen::Map<const Vec<Dim * Dim>>(column.data());
  }
  return differences;
}

/// Checks stress and tangent at F against central differences of density and stress.
template <int Dim>
void expect_law_derivatives(const Mat<Dim>& F, const ElasticModuli& moduli) {
  constexpr double kStep = 1e-6;
  const Mat<Dim> P = elastic_stress<Dim>(F, moduli);
  for (int k = 0; k < Dim * Dim; ++k) {
    Mat<Dim> plus = F, minus = F;
    plus(k) += kStep;
    minus(k) -= kStep;
    EXPECT_NEAR((elastic_density<Dim>(plus, moduli) - elastic_density<Dim>(minus, moduli)) / (2 * kStep), P(k),
                1e-7 * (1 + P.norm()));
  }
  const Flat<Dim> H = matrix_of<Dim>(elastic_eigensystem<Dim>(F, moduli));
  EXPECT_LE((H - differences_of_stress<Dim>(F, moduli)).norm(), 1e-6 * H.norm());
}

/// F near I, of a determinant of at least `least`.
template <int Dim>
Mat<Dim> random_upright(std::mt19937& random, double amount, double least = 0.1) {
  std::normal_distribution<double> normal(0, amount);
  Mat<Dim> F;
  do F = Mat<Dim>::Identity() + Mat<Dim>::NullaryExpr([&] { return normal(random); });
  while (F.determinant() < least);
  return F;
}

}  // namespace itr
