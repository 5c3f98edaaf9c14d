// SPDX-License-Identifier: MIT
// Eigenstrains of all laws: derivatives, where they are free of stress, and parts of the volume.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "energy/elastic/law_sum.hpp"
#include "law_derivatives.hpp"
#include "sums_of_laws.hpp"

namespace itr {
namespace {

/// Laws in which eigenstrains act in different ways.
template <int Dim>
std::vector<Material> laws_with(const Eigenstrain& eigenstrain) {
  const Material base = {.youngs_modulus = 100, .poisson_ratio = 0.4, .density = 3};
  std::vector<Material> laws;
  for (const bool plane_strain : {false, true})
    for (const MaterialLaw law : {MaterialLaw::neo_hookean, MaterialLaw::linear, MaterialLaw::saint_venant_kirchhoff,
                                  MaterialLaw::fixed_corotated, MaterialLaw::mooney_rivlin}) {
      if (plane_strain && (Dim == 3 || law == MaterialLaw::mooney_rivlin)) continue;
      laws.push_back(base);
      laws.back().law = law;
      laws.back().plane_strain = plane_strain;
      laws.back().mooney_rivlin = {.c1 = 20, .c2 = 5, .c3 = 3, .log_k = 100, .volume_d = 30};
    }
  for (const LawSum& sum : sums_of_all_laws<Dim>()) laws.push_back(material_of(sum, Dim));
  for (const LawRow& row : law_rows())
    if (std::string_view(row.type) == "HGOFiber") laws.push_back(material_of(sum_of(row, 3, false), Dim));
  MatrixX C = MatrixX::Identity(Dim == 2 ? 3 : 6, Dim == 2 ? 3 : 6) * 90;
  C.topLeftCorner(Dim, Dim).array() += 40;
  C(0, 0) = 200;
  for (const bool is_small : {false, true}) laws.push_back(tensor_material(C, is_small));
  for (Material& material : laws) material.eigenstrain = eigenstrain;
  return laws;
}

Mat<3> some_strain(int dim) {
  Mat<3> strain;
  strain << 0.12, 0.03, dim == 3 ? -0.02 : 0, 0.03, -0.07, dim == 3 ? 0.04 : 0, strain(0, 2), strain(1, 2), 0.09;
  strain(2, 0) = strain(0, 2);
  strain(2, 1) = strain(1, 2);
  return strain;
}

template <typename T>
class EigenstrainOfLaws : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(EigenstrainOfLaws, Dimensions);

TYPED_TEST(EigenstrainOfLaws, DerivativesMatchDifferences) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(3);
  const auto laws = laws_with<Dim>([](const Vec<3>&, double) { return some_strain(Dim); });
  for (std::size_t i = 0; i < laws.size(); ++i)
    for (int k = 0; k < 5; ++k) {
      SCOPED_TRACE(std::to_string(i) + ": " + name_of(laws[i]));
      expect_law_derivatives<Dim>(random_upright<Dim>(random, 0.15, 0.4), elastic_moduli<Dim>(laws[i], Vec<Dim>::Zero()));
    }
}

/// At F = I + strain nothing pulls, in the directions that the law has.
TYPED_TEST(EigenstrainOfLaws, GrownBodiesAreFreeOfStress) {
  constexpr int Dim = TypeParam::value;
  for (Material material : laws_with<Dim>([](const Vec<3>&, double) { return some_strain(Dim); })) {
    const Mat<Dim> strain = some_strain(Dim).topLeftCorner<Dim, Dim>();
    const ElasticModuli moduli = elastic_moduli<Dim>(material, Vec<Dim>::Zero());
    if (moduli.growth.dimension > Dim)
      material.eigenstrain = [](const Vec<3>&, double) {
        Mat<3> in_plane = some_strain(2);
        in_plane(2, 2) = 0;
        return in_plane;
      };
    const Mat<Dim> P =
        elastic_stress<Dim>(DisplacementGradient<Dim>{strain}, elastic_moduli<Dim>(material, Vec<Dim>::Zero()));
    EXPECT_LE(P.norm(), 1e-11 * material.youngs_modulus) << name_of(material);
  }
}

/// In plane strain the body cannot grow across the plane: it presses there as the law in space does.
TEST(Eigenstrain, PlaneStrainIsTheLawInSpace) {
  std::mt19937 random(5);
  const Eigenstrain strain = [](const Vec<3>&, double) { return some_strain(2); };
  int compared = 0;
  for (const Material& material : laws_with<2>(strain)) {
    const ElasticModuli plane = elastic_moduli<2>(material, Vec<2>::Zero());
    if (plane.growth.dimension == 2) continue;
    ++compared;
    const Mat<2> F = random_upright<2>(random, 0.1, 0.5);
    Mat<3> in_space = Mat<3>::Identity();
    in_space.topLeftCorner<2, 2>() = F;
    const ElasticModuli space = elastic_moduli<3>(material, Vec<3>::Zero());
    EXPECT_NEAR(elastic_density<2>(F, plane), elastic_density<3>(in_space, space), 1e-12 * material.youngs_modulus);
    const Mat<2> in_plane = elastic_stress<3>(in_space, space).topLeftCorner<2, 2>();
    EXPECT_LE((elastic_stress<2>(F, plane) - in_plane).norm(), 1e-11 * material.youngs_modulus);
  }
  EXPECT_GE(compared, 10);
}

/// Parts that cells keep and that patches average add up to the law.
TYPED_TEST(EigenstrainOfLaws, PartsOfTheVolumeAddUp) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(7);
  int compared = 0;
  for (const Material& material : laws_with<Dim>([](const Vec<3>&, double) { return some_strain(Dim); })) {
    if (!may_average_volume(material, Dim)) continue;
    ++compared;
    const ElasticModuli whole = elastic_moduli<Dim>(material, Vec<Dim>::Zero()), cell = without_volume<Dim>(whole);
    for (int k = 0; k < 5; ++k) {
      const Mat<Dim> F = random_upright<Dim>(random, 0.1, 0.5);
      const double change = F.determinant() - 1, h = 1e-6;
      EXPECT_NEAR(elastic_density<Dim>(F, cell) + volume_energy<Dim>(whole, change).value, elastic_density<Dim>(F, whole),
                  1e-10 * material.youngs_modulus)
          << name_of(material);
      const VolumeResponse up = volume_energy<Dim>(whole, change + h), down = volume_energy<Dim>(whole, change - h);
      EXPECT_NEAR((up.value - down.value) / (2 * h), volume_energy<Dim>(whole, change).first,
                  1e-6 * material.youngs_modulus);
      EXPECT_NEAR((up.first - down.first) / (2 * h), volume_energy<Dim>(whole, change).second,
                  1e-5 * material.youngs_modulus);
    }
  }
  EXPECT_GE(compared, 5);
}

}  // namespace
}  // namespace itr
