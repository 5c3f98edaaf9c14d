// SPDX-License-Identifier: MIT
// Terms of volumes and their boundaries: derivatives, projections, and the mechanics that they are.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <random>

#include "derivatives.hpp"
#include "energy/damping.hpp"
#include "energy/elastic/elastic.hpp"
#include "energy/elastic/strain.hpp"
#include "energy/inertia.hpp"
#include "energy/load.hpp"
#include "energy/pressure.hpp"
#include "law_derivatives.hpp"
#include "projection/volume_barrier.hpp"
#include "sums_of_laws.hpp"

namespace itr {
namespace {

const std::map<int, Material> kMaterials = {{1, {.youngs_modulus = 100, .poisson_ratio = 0.4, .density = 3}}};

template <int Dim>
Mesh<Dim> two_cells() {
  if constexpr (Dim == 2)
    return {{{0, 0}, {1, 0}, {1, 1}, {0, 1}}, {{0, 1, 2}, {0, 2, 3}}, {1, 1}};
  else
    return {{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}}, {{0, 1, 2, 3}, {1, 4, 2, 3}}, {1, 1}};
}

/// Positions: rest, stretched and perturbed, all cells upright.
template <int Dim>
VectorX perturbed(const CellSet<Dim>& cells, std::mt19937& random, double amount) {
  std::uniform_real_distribution<double> noise(-amount, amount);
  VectorX x(Dim * cells.num_vertices);
  for (int v = 0; v < cells.num_vertices; ++v)
    for (int c = 0; c < Dim; ++c) x[Dim * v + c] = (c == 0 ? 0.7 : 1.2) * cells.rest[v][c] + noise(random);
  return x;
}

template <typename T>
class VolumeTerms : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(VolumeTerms, Dimensions);

TYPED_TEST(VolumeTerms, DerivativesMatchDifferences) {
  constexpr int Dim = TypeParam::value;
  const CellSet<Dim> cells = whole_mesh(two_cells<Dim>(), {});
  std::mt19937 random(7);
  for (int i = 0; i < 10; ++i) {
    const VectorX x = perturbed(cells, random, 0.1);
    const ElasticEnergy<Dim> elastic(cells, kMaterials, 0.3);
    expect_derivatives(elastic, x, 1e-6, 1e-7);
    expect_psd(elastic, x);
    InertiaEnergy<Dim> inertia(cells, kMaterials, MassKind::consistent, perturbed(cells, random, 0.2));
    inertia.set_unrepresented_history(VectorX::Random(x.size()), 2.5);
    expect_derivatives(inertia, x, 1e-4, 1e-8);
    Loads<Dim> loads;
    loads.acceleration = [](const Vec<Dim>& X) { return Vec<Dim>(X * 2 + Vec<Dim>::Ones()); };
    loads.tractions.emplace_back(kNoTag, [](const Vec<Dim>& X) { return Vec<Dim>(X - Vec<Dim>::Ones()); });
    expect_derivatives(LoadEnergy<Dim>(cells, kMaterials, loads, 0.3), x, 1e-4, 1e-8);
  }
}

/// Projecting by taking out the few negative modes is projecting by leaving them out of the sum of all.
TYPED_TEST(VolumeTerms, NegativeModesAreThoseOfTheEigensystem) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(9);
  std::uniform_real_distribution<double> noise(-1, 1);
  const LameParameters lame{3, 20};
  int negative_stretches = 0;
  for (int i = 0; i < 500; ++i) {
    Mat<Dim> F = Mat<Dim>::Identity() * (i % 3 ? 1 : 2) + Mat<Dim>::NullaryExpr([&] { return noise(random); });
    if (i % 5 == 0) F.col(0) *= 1e-4;  // nearly flat
    if (F.determinant() < 0) F.col(0) = -F.col(0);
    if (F.determinant() < 1e-9) continue;
    using Flat = Vec<Dim * Dim>;
    Mat<Dim*Dim> expected = Mat<Dim * Dim>::Zero(), actual = expected, all = expected;
    const auto add = [](double value, const Mat<Dim>& mode, Mat<Dim * Dim>& sum) {
      const Flat flat = Eigen::Map<const Flat>(mode.data());
      sum += value * flat * flat.transpose();
    };
    const auto system = neo_hookean_eigensystem<Dim>(F, lame);
    for (int k = 0; k < Dim * Dim; ++k) {
      add(system.values[k], system.modes[k], all);
      if (system.values[k] < 0) add(system.values[k], system.modes[k], expected);
      negative_stretches += k < Dim && system.values[k] < 0;
    }
    const auto negative = neo_hookean_negative_modes<Dim>(F, lame);
    for (int k = 0; k < negative.count; ++k) add(negative.values[k], negative.modes[k], actual);
    EXPECT_LE((actual - expected).norm(), 1e-12 * all.norm());
    if (i % 5 == 0) continue;  // differences lose too many digits there
    const double h = 1e-6;
    for (int k = 0; k < Dim * Dim; ++k) {
      Mat<Dim> plus = F, minus = F;
      plus.data()[k] += h;
      minus.data()[k] -= h;
      const Mat<Dim> column = (neo_hookean_stress<Dim>(plus, lame) - neo_hookean_stress<Dim>(minus, lame)) / (2 * h);
      EXPECT_LE((all.col(k) - Eigen::Map<const Flat>(column.data())).norm(), 1e-4 * (1 + all.norm()));
    }
  }
  EXPECT_GT(negative_stretches, 0);
}

/// The linear law of small strains of a material.
Material linear_of(const Material& material) {
  return {.law = MaterialLaw::linear,
          .youngs_modulus = material.youngs_modulus,
          .poisson_ratio = material.poisson_ratio,
          .plane_strain = material.plane_strain};
}

/// All isotropic laws; those that are no sums have the same moduli of small strains (E = 100, nu = 0.4) in the dimension.
template <int Dim>
std::vector<Material> all_laws() {
  const Material base = {.youngs_modulus = 100, .poisson_ratio = 0.4, .density = 3};
  std::vector<Material> laws(6, base);
  laws[1].law = MaterialLaw::linear;
  laws[2].law = MaterialLaw::saint_venant_kirchhoff;
  laws[3].law = MaterialLaw::fixed_corotated;
  const double mu = base.lame_mu(), bulk = base.lame_lambda(Dim) + 2 * mu / Dim;
  laws[4].law = laws[5].law = MaterialLaw::mooney_rivlin;
  const double c2 = 0.1 * mu, c1 = mu / 2 - (Dim == 3 ? c2 : 0);
  laws[4].mooney_rivlin = {.c1 = c1, .c2 = c2, .log_k = bulk};
  const double c3 = 0.2 * mu;
  laws[5].mooney_rivlin = {.c1 = c1 + (Dim == 2 ? c3 : 0), .c2 = c2, .c3 = c3, .volume_d = bulk / 2};
  for (const LawSum& sum : sums_of_all_laws<Dim>()) laws.push_back(material_of(sum, Dim));
  return laws;
}

TYPED_TEST(VolumeTerms, AllLawsMatchDifferences) {
  constexpr int Dim = TypeParam::value;
  const CellSet<Dim> cells = whole_mesh(two_cells<Dim>(), {});
  std::mt19937 random(17);
  for (const Material& material : all_laws<Dim>())
    for (int i = 0; i < 10; ++i) {
      SCOPED_TRACE(name_of(material));
      const VectorX x = perturbed(cells, random, 0.1);
      const ElasticEnergy<Dim> elastic(cells, {{1, material}}, 0.3);
      expect_derivatives(elastic, x, 1e-6, 1e-7);
      expect_psd(elastic, x);
    }
}

TYPED_TEST(VolumeTerms, ProjectionClampsTheEigenvaluesOfTheExactHessian) {
  constexpr int Dim = TypeParam::value;
  std::mt19937 random(5);
  int indefinite = 0;
  for (const Material& material : all_laws<Dim>())
    for (int i = 0; i < 30; ++i) {
      SCOPED_TRACE(name_of(material));
      const Mat<Dim> F = random_upright<Dim>(random, 0.4);
      const ElasticModuli moduli = elastic_moduli<Dim>(material, Vec<Dim>::Zero());
      EigenSystem<Dim> system = elastic_eigensystem<Dim>(F, moduli);
      const Flat<Dim> H = matrix_of<Dim>(system);
      ASSERT_LE((H - differences_of_stress<Dim>(F, moduli)).norm(), 1e-6 * H.norm());

      const Eigen::SelfAdjointEigenSolver<Flat<Dim>> eigen(H);
      if (eigen.eigenvalues()[0] < -1e-3 * H.norm()) ++indefinite;
      const Flat<Dim> clamped =
          eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).asDiagonal() * eigen.eigenvectors().transpose();
      for (double& value : system.values) value = std::max(value, 0.0);
      EXPECT_LE((matrix_of<Dim>(system) - clamped).norm(), 1e-12 * H.norm());

      // And that is what an element's projected block is made of.
      Mesh<Dim> mesh = two_cells<Dim>();
      std::vector<Vec<Dim>> corners;
      for (int k = 0; k <= Dim; ++k) corners.push_back(mesh.rest(mesh.cell(0)[k]));
      typename Mesh<Dim>::Cell cell;
      for (int k = 0; k <= Dim; ++k) cell[k] = k;
      const CellSet<Dim> one = whole_mesh(Mesh<Dim>(corners, {cell}, {1}), {});
      MatrixX B = MatrixX::Zero(Dim * Dim, Dim * (Dim + 1));
      VectorX x(Dim * (Dim + 1));
      for (int v = 0; v <= Dim; ++v) {
        x.segment<Dim>(Dim * v) = F * one.rest[v];
        for (int j = 0; j < Dim; ++j) {
          const double slope =
              v == 0 ? -one.elements[0].inverse_edges.col(j).sum() : one.elements[0].inverse_edges(v - 1, j);
          for (int c = 0; c < Dim; ++c) B(Dim * j + c, Dim * v + c) = slope;
        }
      }
      const MatrixX expected = one.elements[0].volume * B.transpose() * clamped * B;
      const ElasticEnergy<Dim> elastic(one, {{1, material}}, 1);
      EXPECT_LE((hessian_of(elastic, x, PsdProjection::clamp) - expected).norm(), 1e-10 * (1 + expected.norm()));
    }
  EXPECT_GT(indefinite, 10);
}

TYPED_TEST(VolumeTerms, AllLawsAreLinearElasticityAtSmallStrains) {
  constexpr int Dim = TypeParam::value;
  const Mat<Dim> identity = Mat<Dim>::Identity();
  const auto laws = all_laws<Dim>();
  Mat<Dim> rotation = identity;
  rotation.template topLeftCorner<2, 2>() << std::cos(1.0), -std::sin(1.0), std::sin(1.0), std::cos(1.0);
  for (const Material& material : laws) {
    SCOPED_TRACE(name_of(material));
    const ElasticModuli moduli = elastic_moduli<Dim>(material, Vec<Dim>::Zero());
    const Flat<Dim> linear =
        matrix_of<Dim>(elastic_eigensystem<Dim>(identity, elastic_moduli<Dim>(linear_of(material), Vec<Dim>::Zero())));
    EXPECT_LE((matrix_of<Dim>(elastic_eigensystem<Dim>(identity, moduli)) - linear).norm(), 1e-12 * linear.norm());
    EXPECT_NEAR(elastic_density<Dim>(identity, moduli), 0, 1e-12);
    EXPECT_LE(elastic_stress<Dim>(identity, moduli).norm(), 1e-12);
    EXPECT_TRUE(std::isinf(elastic_density<Dim>(-Vec<Dim>::Unit(0).asDiagonal().toDenseMatrix(), moduli)));
    if (material.law == MaterialLaw::linear) continue;
    EXPECT_NEAR(elastic_density<Dim>(rotation, moduli), 0, 1e-12);
    EXPECT_LE(elastic_stress<Dim>(rotation, moduli).norm(), 1e-12);
  }
}

/// Small strains leave no more than their own size between all laws and linear elasticity, before and after a rotation.
TYPED_TEST(VolumeTerms, DensitiesAndStressesKeepTheirDigitsAtSmallStrains) {
  constexpr int Dim = TypeParam::value;
  constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
  std::mt19937 random(11);
  const Mat<Dim> identity = Mat<Dim>::Identity();
  Mat<Dim> rotation = identity;
  rotation.template topLeftCorner<2, 2>() << std::cos(0.7), -std::sin(0.7), std::sin(0.7), std::cos(0.7);
  const auto laws = all_laws<Dim>();
  for (const Material& material : laws) {
    if (material.law == MaterialLaw::own && !sum_of(material)) continue;  // its program's precision
    SCOPED_TRACE(name_of(material));
    const ElasticModuli moduli = elastic_moduli<Dim>(material, Vec<Dim>::Zero());
    const ElasticModuli linear = elastic_moduli<Dim>(linear_of(material), Vec<Dim>::Zero());
    for (const double strain : {1e-14, 1e-11, 1e-8, 1e-5}) {
      SCOPED_TRACE(strain);
      const Mat<Dim> any = random_upright<Dim>(random, 0.4) - identity;
      const DisplacementGradient<Dim> at{strain * (any + any.transpose())};
      const double W = elastic_density<Dim>(at, linear);
      const Mat<Dim> P = elastic_stress<Dim>(at, linear);
      const double tolerance = 20 * strain + 50 * kEpsilon;
      EXPECT_NEAR(elastic_density<Dim>(at, moduli), W, tolerance * W);
      EXPECT_LE((elastic_stress<Dim>(at, moduli) - P).norm(), tolerance * P.norm());
      if (material.law == MaterialLaw::linear) continue;
      const DisplacementGradient<Dim> turned{rotation * at.G + (rotation - identity)};
      EXPECT_NEAR(elastic_density<Dim>(turned, moduli), W, tolerance * W + 100 * kEpsilon / strain * W);
      EXPECT_LE((elastic_stress<Dim>(turned, moduli) - rotation * P).norm(),
                (tolerance + 100 * kEpsilon / strain) * P.norm());
    }
  }
}

TEST(Strain, RemaindersKeepTheirDigits) {
  for (const double x : {1e-12, -1e-9, 1e-4, -0.01, 0.0624, 0.0626, -0.0624, 0.24, -0.26, 0.9, -0.9, 30.0}) {
    const long double exact = x;
    const long double log =
        std::abs(x) < 1e-3 ? exact * exact * (0.5L - exact / 3 + exact * exact / 4) : exact - std::log1p(exact);
    const long double exp =
        std::abs(x) < 1e-3 ? exact * exact * (0.5L + exact / 6 + exact * exact / 24) : std::expm1(exact) - exact;
    EXPECT_NEAR(minus_log1p(x) / static_cast<double>(log), 1, 1e-12) << x;
    EXPECT_NEAR(minus_expm1(x) / static_cast<double>(exp), 1, 1e-12) << x;
  }
}

TYPED_TEST(VolumeTerms, ModuliThatVaryAreThoseOfEachElement) {
  constexpr int Dim = TypeParam::value;
  const CellSet<Dim> cells = whole_mesh(two_cells<Dim>(), {});
  std::mt19937 random(2);
  const VectorX x = perturbed(cells, random, 0.1);
  Material varying = kMaterials.at(1);
  varying.youngs_modulus_at = [](const Vec<3>& X) { return 100 * (1 + X[0]); };
  Workspace workspace;
  double sum = 0;
  for (std::size_t e = 0; e < 2; ++e) {
    CellSet<Dim> one = cells;
    one.elements = {cells.elements[e]};
    Material constant = kMaterials.at(1);
    constant.youngs_modulus = 100 * (1 + rest_barycenter(cells, cells.elements[e])[0]);
    sum += ElasticEnergy<Dim>(one, {{1, constant}}, 1).value(x, workspace);
  }
  const ElasticEnergy<Dim> elastic(cells, {{1, varying}}, 1);
  EXPECT_NEAR(elastic.value(x, workspace), sum, 1e-12 * sum);
  expect_derivatives(elastic, x, 1e-6, 1e-7);
}

/// Area times outward normal of a facet over the number of its corners.
Vec<2> area_fraction(const Vec<2>& a, const Vec<2>& b) { return {(b - a)[1] / 2, -(b - a)[0] / 2}; }
Vec<3> area_fraction(const Vec<3>& a, const Vec<3>& b, const Vec<3>& c) { return (b - a).cross(c - a) / 6; }

TYPED_TEST(VolumeTerms, PressurePushesAlongInwardNormalsOfTheDeformedSurface) {
  constexpr int Dim = TypeParam::value;
  CellSet<Dim> cells = whole_mesh(two_cells<Dim>(), {});
  std::mt19937 random(11);
  for (const bool is_closed : {true, false}) {
    for (auto& facet : cells.facets) facet.tag = 5;
    if (!is_closed) cells.facets.back().tag = 6;
    Loads<Dim> loads;
    loads.pressures.emplace_back(5, [](const Vec<Dim>&) { return 2.5; });
    const VectorX lagged = perturbed(cells, random, 0.1);
    const PressureEnergy<Dim> energy(cells, loads, lagged, 0.3);
    VectorX expected = VectorX::Zero(lagged.size());
    for (const auto& facet : cells.facets) {
      if (facet.tag != 5) continue;
      std::array<Vec<Dim>, Dim> p;
      for (int k = 0; k < Dim; ++k) p[k] = vertex_of<Dim>(lagged, facet.vertices[k]);
      const Vec<Dim> fraction = std::apply([](const auto&... corner) { return area_fraction(corner...); }, p);
      for (const int v : facet.vertices)
        vertex_of<Dim>(expected, v) += 0.3 * 2.5 * fraction;  // the gradient: minus the force
    }
    EXPECT_LE((gradient_of(energy, lagged) - expected).norm(), 1e-13);
    EXPECT_EQ(energy.is_lagged(all_free(lagged.size())), !is_closed);
    for (int i = 0; i < 5; ++i) {
      const VectorX x = perturbed(cells, random, 0.1);
      expect_derivatives(energy, x, 1e-5, 1e-8);
      expect_psd(energy, x);
      if (!is_closed) continue;
      Vec<Dim> resultant = Vec<Dim>::Zero();
      const VectorX gradient = gradient_of(energy, x);
      for (int v = 0; v < cells.num_vertices; ++v) resultant += vertex_of<Dim>(gradient, v);
      EXPECT_LE(resultant.norm(), 1e-13);
    }
    Workspace workspace;
    VectorX rest(lagged.size());
    for (int v = 0; v < cells.num_vertices; ++v) vertex_of<Dim>(rest, v) = cells.rest[v];
    EXPECT_NEAR(energy.value(rest, workspace), 0, 1e-14);
  }
}

TYPED_TEST(VolumeTerms, UnitMassDiagonalIsThatOfTheConsistentMass) {
  constexpr int Dim = TypeParam::value;
  const Vec<Dim> obstacle = Vec<Dim>::Zero();
  const CellSet<Dim> cells = whole_mesh(two_cells<Dim>(), {obstacle});
  const std::map<int, Material> unit = {{1, {.density = 1}}};
  const VectorX zero = VectorX::Zero(Dim * cells.num_vertices);
  const VectorX mass =
      hessian_of(InertiaEnergy<Dim>(cells, unit, MassKind::consistent, zero), zero, PsdProjection::none).diagonal();
  const Eigen::Index bodies = zero.size() - Dim;
  const VectorX diagonal = unit_mass_diagonal(cells);
  EXPECT_LE((diagonal - mass).head(bodies).norm(), 1e-15);
  EXPECT_NEAR(diagonal[bodies], mass.head(bodies).mean(), 1e-15);
}

TYPED_TEST(VolumeTerms, DampingIsTheStiffnessTimesVelocity) {
  constexpr int Dim = TypeParam::value;
  const CellSet<Dim> cells = whole_mesh(two_cells<Dim>(), {});
  std::mt19937 random(13);
  const VectorX lagged = perturbed(cells, random, 0.2), reference = perturbed(cells, random, 0.1);
  const ElasticEnergy<Dim> elastic(cells, kMaterials, 0.25);
  Workspace workspace;
  const DampingEnergy<Dim> energy(elastic, lagged, 0.02, {8, reference}, workspace);
  const MatrixX K = hessian_of(elastic, lagged, PsdProjection::clamp);
  for (int i = 0; i < 5; ++i) {
    const VectorX x = perturbed(cells, random, 0.1), v = 8 * (x - reference);
    EXPECT_NEAR(energy.value(x, workspace), 0.02 / (2 * 8) * v.dot(K * v), 1e-12 * v.dot(K * v));
    EXPECT_LE((gradient_of(energy, x) - 0.02 * K * v).norm(), 1e-12 * (K * v).norm());
    expect_derivatives(energy, x, 1e-5, 1e-7);
    expect_psd(energy, x);
  }
}

TYPED_TEST(VolumeTerms, DampingForcesOfFastBodiesAddUp) {
  constexpr int Dim = TypeParam::value;
  const CellSet<Dim> cells = whole_mesh(two_cells<Dim>(), {});
  std::mt19937 random(14);
  const VectorX lagged = perturbed(cells, random, 0.2);
  const ElasticEnergy<Dim> elastic(cells, kMaterials, 0.25);
  Workspace workspace;
  const DampingEnergy<Dim> energy(elastic, lagged, 0.02, {8, lagged}, workspace);
  VectorX x = lagged;  // all go by 1 m, and by a billionth of that apart
  for (double& place : x) place += 1 + 1e-9 * std::uniform_real_distribution<double>(-1, 1)(random);
  const VectorX gradient = gradient_of(energy, x);
  Vec<Dim> total = Vec<Dim>::Zero();
  for (Eigen::Index i = 0; i < gradient.size(); i += Dim) total += gradient.segment<Dim>(i);
  EXPECT_GT(gradient.norm(), 0);
  EXPECT_LE(total.norm(), 1e-13 * gradient.template lpNorm<1>());
}

TYPED_TEST(VolumeTerms, VolumeBarrierGradientMatchesDifferences) {
  constexpr int Dim = TypeParam::value;
  const CellSet<Dim> cells = whole_mesh(two_cells<Dim>(), {});
  std::mt19937 random(3);
  VectorX x = perturbed(cells, random, 0.01);
  const VolumeBarrier<Dim> barrier(cells, 5.0, 2.0);  // acts on every element
  Workspace workspace;
  const VectorX gradient = gradient_of(barrier, x);
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    VectorX plus = x, minus = x;
    plus[i] += 1e-6;
    minus[i] -= 1e-6;
    EXPECT_NEAR(gradient[i], (barrier.value(plus, workspace) - barrier.value(minus, workspace)) / 2e-6,
                1e-6 * gradient.norm());
  }
  expect_psd(barrier, x);
}

TYPED_TEST(VolumeTerms, ElasticityDoesNotSeeRigidMotion) {
  constexpr int Dim = TypeParam::value;
  const CellSet<Dim> cells = whole_mesh(two_cells<Dim>(), {});
  Mat<Dim> rotation = Mat<Dim>::Identity();
  rotation.template topLeftCorner<2, 2>() << std::cos(1.0), -std::sin(1.0), std::sin(1.0), std::cos(1.0);
  VectorX x(Dim * cells.num_vertices);
  for (int v = 0; v < cells.num_vertices; ++v) x.segment<Dim>(Dim * v) = rotation * cells.rest[v] + 3 * Vec<Dim>::Ones();
  Workspace workspace;
  const ElasticEnergy<Dim> elastic(cells, kMaterials, 1);
  EXPECT_NEAR(elastic.value(x, workspace), 0, 1e-13);
  EXPECT_LE(gradient_of(elastic, x).norm(), 1e-12);
}

TYPED_TEST(VolumeTerms, InversionIsInfeasibleAndTheStepStopsBeforeIt) {
  constexpr int Dim = TypeParam::value;
  const CellSet<Dim> cells = whole_mesh(two_cells<Dim>(), {});
  const ElasticEnergy<Dim> elastic(cells, kMaterials, 1);
  Workspace workspace;
  VectorX x(Dim * cells.num_vertices), dx = VectorX::Zero(Dim * cells.num_vertices);
  for (int v = 0; v < cells.num_vertices; ++v) x.segment<Dim>(Dim * v) = cells.rest[v];
  dx.segment<Dim>(Dim) = -3 * Vec<Dim>::Unit(0);  // pushes vertex 1 through the cell
  EXPECT_TRUE(std::isinf(elastic.value(x + dx, workspace)));
  const double step = elastic.max_step(x, dx, workspace);
  EXPECT_GT(step, 0.1);
  EXPECT_LT(step, 1.0 / 3);
  EXPECT_TRUE(std::isfinite(elastic.value(x + step * dx, workspace)));
}

}  // namespace
}  // namespace itr
