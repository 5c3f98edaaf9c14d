// SPDX-License-Identifier: MIT
// Laws of the table against closed forms of tests in the laboratory, and fibres against differences.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "energy/elastic/law_sum.hpp"
#include "law_derivatives.hpp"
#include "sums_of_laws.hpp"

namespace itr {
namespace {

const LawRow& row_of(const std::string& type) {
  for (const LawRow& row : law_rows())
    if (row.type == type) return row;
  throw std::out_of_range(type);
}

TEST(LawTable, EveryLawHasAnExample) {
  for (const LawRow& row : law_rows()) {
    ASSERT_TRUE(examples_of_laws().contains(row.type)) << row.type;
    EXPECT_EQ(examples_of_laws().at(row.type).size(), row.coefficients.size()) << row.type;
    EXPECT_NE(row.add == nullptr, row.fibre == nullptr) << row.type;
  }
}

/// s dW/ds of an incompressible body whose stretches are s^powers, along the first with the third free of stress.
double nominal_stress(const LawSum& sum, double s, const Vec<3>& powers) {
  const StretchSum response = response_to(sum, powers * std::log(s), 0);
  return (response.first[0] - response.first[2]) / s;
}

/// Stretches of uniaxial, equibiaxial and planar tension: powers of the first.
const Vec<3> kUniaxial(1, -0.5, -0.5), kBiaxial(1, 1, -2), kPlanar(1, 0, -1);

/// Textbook forms of dW/ds - (s_3 / s) dW/ds_3 by the first stretch and the third.
TEST(LawTable, IncompressibleTestsHaveTheirClosedForms) {
  using Form = std::function<double(double s, double third, double I1, double I2)>;
  const std::map<std::string, Form> forms = {
      {"Yeoh",
       [](double s, double r, double I1, double) {
         const double x = I1 - 3;
         return 2 * (s - r * r / s) * (20 + 2 * 3 * x + 3 * 0.4 * x * x);
       }},
      {"Ogden",
       [](double s, double r, double, double) {
         const auto term = [&](double mu, double alpha) { return mu * (std::pow(s, alpha) - std::pow(r, alpha)) / s; };
         return term(30, 1.3) + term(2, 5) + term(-5, -2);
       }},
      {"ArrudaBoyce",
       [](double s, double r, double I1, double) {
         const double n = 2.5 * 2.5, t = I1 / n;
         const double slope = 1.0 / 2 + t / 10 + 11 * t * t / 350 + 19 * t * t * t / 1750 + 519 * t * t * t * t / 134750;
         return 2 * (s - r * r / s) * 35 * slope;
       }},
      {"IsochoricMooneyRivlin",
       [](double s, double r, double, double) {
         const double middle = 1 / (s * r);
         return 2 * (s - r * r / s) * (12 + 5 * middle * middle);
       }},
      {"Hencky", [](double s, double r, double, double) { return 2 * 35 * std::log(s / r) / s; }},
      {"NeoHookean", [](double s, double r, double, double) { return 35 * (s - r * r / s); }},
  };
  for (const auto& [type, form] : forms)
    for (const Vec<3>& powers : {kUniaxial, kBiaxial, kPlanar})
      for (const double s : {0.4, 0.9, 1.0, 1.5, 3.0}) {
        const LawSum sum = sum_of(row_of(type), 3, false);
        const Vec<3> stretches = (powers * std::log(s)).array().exp();
        const double I1 = stretches.squaredNorm(), I2 = stretches.cwiseInverse().squaredNorm();
        const double expected = form(s, stretches[2], I1, I2);
        EXPECT_NEAR(nominal_stress(sum, s, powers), expected, 1e-12 * std::max(100.0, std::abs(expected)))
            << type << " " << s;
      }
}

/// A foam of Poisson's ratio 0 does not widen: P = 2 mu / alpha (s^alpha - 1) / s.
TEST(LawTable, FoamWithoutContractionIsOneDimensional) {
  LawSum sum;
  sum.terms.push_back({&row_of("Hyperfoam"), {{20}, {3}, {0}}});
  for (const double s : {0.2, 0.7, 1.4}) {
    const StretchSum response = response_to(sum, {std::log(s), 0, 0}, std::log(s));
    EXPECT_NEAR(response.first[0], 2 * 20 / 3. * (s * s * s - 1), 1e-12);
    EXPECT_NEAR(response.first[2], 0, 1e-12);
  }
}

TEST(LawTable, VolumeChangesAreThoseOfTheBulkModulus) {
  const LawSum sum = sum_of(row_of("Yeoh"), 3, false);
  for (const double J : {0.5, 0.999, 1.7}) {
    const StretchSum response = response_to(sum, Vec<3>::Constant(std::log(J) / 3), std::log(J));
    EXPECT_NEAR(response.value, 200 / 4. * (J * J - 1 - 2 * std::log(J)), 1e-12);
    EXPECT_NEAR(response.first.sum() / 3, 200 / 2. * (J * J - 1), 1e-11);
  }
}

/// In plane stress the response is that of the space with the third stretch that a search by halves finds.
TEST(LawTable, PlaneStressIsTheSpaceWithoutStressAcrossThePlane) {
  for (const LawSum& sum : sums_of_all_laws<2>()) {
    if (!sum.is_plane_stress) continue;
    LawSum in_space = sum;
    in_space.is_plane_stress = false;
    for (const auto& [a, b] : {std::pair(0.3, -0.1), std::pair(0.05, 0.05), std::pair(-0.4, 0.2), std::pair(0.6, 0.5)}) {
      double low = -3, high = 3;
      for (int i = 0; i < 100; ++i) {
        const double middle = (low + high) / 2;
        (response_to(in_space, {a, b, middle}, a + b + middle).first[2] < 0 ? low : high) = middle;
      }
      const StretchSum expected = response_to(in_space, {a, b, low}, a + b + low);
      const StretchSum found = response_to(sum, {a, b, 0}, a + b);
      const double scale = expected.second.norm();
      EXPECT_NEAR(found.value, expected.value, 1e-13 * scale) << sum.name();
      EXPECT_LE((found.first - expected.first).norm(), 1e-12 * scale) << sum.name();
      const Mat<2> stretched = Vec<2>(std::exp(a), std::exp(b)).asDiagonal();
      EXPECT_NEAR(thickness<2>(stretched, elastic_moduli<2>(material_of(sum, 2), Vec<2>(0, 0))), std::exp(low), 1e-12)
          << sum.name();
    }
  }
}

TEST(LawTable, PlaneStrainIsTheSpaceWithAThirdStretchOfOne) {
  std::mt19937 random(6);
  for (const LawRow& row : law_rows()) {
    const LawSum sum = sum_of(row, 3, false);
    const ElasticModuli moduli{.law = MaterialLaw::own, .own = &sum};
    for (int i = 0; i < 10; ++i) {
      const Mat<2> F = random_upright<2>(random, 0.2, 0.3);
      Mat<3> in_space = Mat<3>::Identity();
      in_space.topLeftCorner<2, 2>() = F;
      EXPECT_NEAR(elastic_density<2>(F, moduli), elastic_density<3>(in_space, moduli), 1e-11) << row.type;
      const Mat<2> P = elastic_stress<2>(F, moduli);
      EXPECT_LE((P - elastic_stress<3>(in_space, moduli).topLeftCorner<2, 2>()).norm(), 1e-12 * (100 + P.norm()))
          << row.type;
    }
  }
}

/// Equal stretches, and stretches that differ by a rounding, have the tangent of stretches near them.
TEST(LawTable, TangentsAreStableAtEqualStretches) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> noise(-1, 1);
  for (const LawSum& sum : sums_of_all_laws<3>()) {
    const ElasticModuli moduli{.law = MaterialLaw::own, .own = &sum};
    const auto tangent = [&](const Mat<3>& F) { return matrix_of<3>(elastic_eigensystem<3>(F, moduli)); };
    const Mat<3> F = Vec<3>(1.3, 1.3, 0.8).asDiagonal();
    const Mat<9> at_equal = tangent(F);
    for (const double size : {1e-16, 1e-13, 1e-9, 1e-7})
      EXPECT_LE((tangent(F + size * Mat<3>::NullaryExpr([&] { return noise(random); })) - at_equal).norm(),
                (1e-11 + 100 * size) * at_equal.norm())
          << sum.name() << " " << size;
  }
}

template <typename T>
class Fibres : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(Fibres, Dimensions);

TYPED_TEST(Fibres, DerivativesMatchDifferences) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(8);
  int pulled = 0;
  for (const LawRow& row : law_rows())
    for (const int dimension : {Dim, 3}) {
      if (!row.fibre) continue;
      const Material material = material_of(sum_of(row, dimension, false), Dim);
      const ElasticModuli moduli = elastic_moduli<Dim>(material, Vec<Dim>::Zero());
      for (int i = 0; i < 40; ++i) {
        const Mat<Dim> F = random_upright<Dim>(random, 0.25, 0.3);
        const double kappa = row.dispersion < 0 ? 0 : 0.1;
        const Vec<Dim> a = Vec<3>(Vec<3>(1, 2, 2) / 3).head<Dim>();
        const Mat<Dim> M = kappa * Mat<Dim>::Identity() + (1 - dimension * kappa) * a * a.transpose();
        const Mat<Dim> change = F.transpose() * F - Mat<Dim>::Identity();
        const double x = (1 + (M * change).trace()) * std::pow(F.determinant(), -2.0 / dimension) - 1;
        if (std::abs(x) < 1e-3) continue;  // where HGO's fibres begin to pull, second derivatives jump
        pulled += x > 0;
        SCOPED_TRACE(std::string(row.type) + " " + std::to_string(i));
        expect_law_derivatives<Dim>(F, moduli);
      }
    }
  EXPECT_GT(pulled, 20);
}

/// w is k1 / (2 k2) (exp(k2 x^2) - 1) of a fibre that isochoric tension stretches by s: x = s^2 - 1.
TEST(FibreLaws, HaveTheirClosedForms) {
  for (const double s : {0.8, 1.3, 2.0}) {
    const Mat<3> F = Vec<3>(s, 1 / std::sqrt(s), 1 / std::sqrt(s)).asDiagonal();
    const auto density = [&](const char* type, const LawValues& values) {
      LawSum sum;
      sum.terms.push_back({&row_of(type), values, [](const Vec<3>&) { return Vec<3>(1, 0, 0); }});
      const ElasticModuli moduli{.law = MaterialLaw::own, .own = &sum};
      return elastic_density<3>(F, moduli);
    };
    const double x = s * s - 1, dispersed = 0.2 * (s * s + 2 / s - 3) + 0.4 * x;
    EXPECT_NEAR(density("HGOFiber", {{3}, {0.7}, {0}}), s > 1 ? 3 / 1.4 * std::expm1(0.7 * x * x) : 0, 1e-11);
    EXPECT_NEAR(density("HGOFiber", {{3}, {0.7}, {0.2}}),
                dispersed > 0 ? 3 / 1.4 * std::expm1(0.7 * dispersed * dispersed) : 0, 1e-11);
    EXPECT_NEAR(density("ActiveFiber", {{4}, {0.25}}), -0.5 * x, 1e-12);
  }
}

}  // namespace
}  // namespace itr
