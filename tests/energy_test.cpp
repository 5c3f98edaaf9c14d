// SPDX-License-Identifier: MIT
// Derivatives of every term against central differences, and what projected Hessians promise.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <random>

#include "itr/core/parallel.hpp"
#include "itr/energy/contact/friction.hpp"
#include "itr/energy/contact/stiffness.hpp"
#include "itr/energy/damping.hpp"
#include "itr/energy/elastic/elastic.hpp"
#include "itr/energy/inertia.hpp"
#include "itr/energy/load.hpp"
#include "itr/energy/pressure.hpp"
#include "itr/projection/volume_barrier.hpp"

namespace itr {
namespace {

const std::map<int, Material> kMaterials = {{1, {.youngs_modulus = 100, .poisson_ratio = 0.4, .density = 3}}};

DofMap all_free(Eigen::Index dofs) { return DofMap::from_held(std::vector<char>(dofs, 0)); }

MatrixX hessian_of(const Energy& energy, const VectorX& x, PsdProjection psd) {
  Workspace workspace;
  const DofMap dofs = all_free(x.size());
  MatrixX lower = MatrixX::Zero(x.size(), x.size());
  HessianSink sink(dofs, lower);
  energy.add_hessian(x, psd, sink, workspace);
  return lower.selfadjointView<Eigen::Lower>();
}

VectorX gradient_of(const Energy& energy, const VectorX& x) {
  Workspace workspace;
  VectorX gradient = VectorX::Zero(x.size());
  energy.add_gradient(x, gradient, workspace);
  return gradient;
}

/// Checks both derivatives at x to a relative error that central differences of step `h` reach.
void expect_derivatives(const Energy& energy, const VectorX& x, double h, double tolerance) {
  Workspace workspace;
  const VectorX gradient = gradient_of(energy, x);
  const MatrixX hessian = hessian_of(energy, x, PsdProjection::none);
  VectorX difference(x.size());
  MatrixX second(x.size(), x.size());
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    VectorX plus = x, minus = x;
    plus[i] += h;
    minus[i] -= h;
    difference[i] = (energy.value(plus, workspace) - energy.value(minus, workspace)) / (2 * h);
    second.col(i) = (gradient_of(energy, plus) - gradient_of(energy, minus)) / (2 * h);
  }
  EXPECT_LE((gradient - difference).norm(), tolerance * (1e-12 + gradient.norm())) << energy.name();
  EXPECT_LE((hessian - second).norm(), tolerance * (1e-12 + hessian.norm())) << energy.name();
}

void expect_psd(const Energy& energy, const VectorX& x) {
  const MatrixX projected = hessian_of(energy, x, PsdProjection::clamp);
  const Eigen::SelfAdjointEigenSolver<MatrixX> eigen(projected);
  EXPECT_GE(eigen.eigenvalues()[0], -1e-10 * projected.norm()) << energy.name();
  // Turning a negative eigenvalue adds twice as much to the true Hessian as leaving it out.
  const MatrixX exact = hessian_of(energy, x, PsdProjection::none),
                absolute = hessian_of(energy, x, PsdProjection::absolute);
  EXPECT_LE((absolute - exact - 2 * (projected - exact)).norm(), 1e-10 * projected.norm()) << energy.name();
}

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

/// All laws, with the same moduli of small strains (E = 100, nu = 0.4) in the dimension.
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
  return laws;
}

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

template <int Dim>
Mat<Dim> random_upright(std::mt19937& random, double amount) {
  std::normal_distribution<double> normal(0, amount);
  Mat<Dim> F;
  do F = Mat<Dim>::Identity() + Mat<Dim>::NullaryExpr([&] { return normal(random); });
  while (F.determinant() < 0.1);
  return F;
}

TYPED_TEST(VolumeTerms, AllLawsMatchDifferences) {
  constexpr int Dim = TypeParam::value;
  const CellSet<Dim> cells = whole_mesh(two_cells<Dim>(), {});
  std::mt19937 random(17);
  for (const Material& material : all_laws<Dim>())
    for (int i = 0; i < 10; ++i) {
      SCOPED_TRACE(static_cast<int>(material.law));
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
      SCOPED_TRACE(static_cast<int>(material.law));
      const Mat<Dim> F = random_upright<Dim>(random, 0.4);
      const ElasticModuli moduli = elastic_moduli<Dim>(material, Vec<Dim>::Zero());
      EigenSystem<Dim> system = elastic_eigensystem<Dim>(F, moduli);
      const Flat<Dim> H = matrix_of<Dim>(system);
      Flat<Dim> differences;
      for (int k = 0; k < Dim * Dim; ++k) {
        Mat<Dim> plus = F, minus = F;
        plus.data()[k] += 1e-6;
        minus.data()[k] -= 1e-6;
        const Mat<Dim> column = (elastic_stress<Dim>(plus, moduli) - elastic_stress<Dim>(minus, moduli)) / 2e-6;
        differences.col(k) = Eigen::Map<const Vec<Dim * Dim>>(column.data());
      }
      ASSERT_LE((H - differences).norm(), 1e-6 * H.norm());

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
  const Flat<Dim> linear =
      matrix_of<Dim>(elastic_eigensystem<Dim>(identity, elastic_moduli<Dim>(laws[1], Vec<Dim>::Zero())));
  Mat<Dim> rotation = identity;
  rotation.template topLeftCorner<2, 2>() << std::cos(1.0), -std::sin(1.0), std::sin(1.0), std::cos(1.0);
  for (const Material& material : laws) {
    SCOPED_TRACE(static_cast<int>(material.law));
    const ElasticModuli moduli = elastic_moduli<Dim>(material, Vec<Dim>::Zero());
    EXPECT_LE((matrix_of<Dim>(elastic_eigensystem<Dim>(identity, moduli)) - linear).norm(), 1e-12 * linear.norm());
    EXPECT_NEAR(elastic_density<Dim>(identity, moduli), 0, 1e-12);
    EXPECT_LE(elastic_stress<Dim>(identity, moduli).norm(), 1e-12);
    EXPECT_TRUE(std::isinf(elastic_density<Dim>(-Vec<Dim>::Unit(0).asDiagonal().toDenseMatrix(), moduli)));
    if (material.law == MaterialLaw::linear) continue;
    EXPECT_NEAR(elastic_density<Dim>(rotation, moduli), 0, 1e-12);
    EXPECT_LE(elastic_stress<Dim>(rotation, moduli).norm(), 1e-12);
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
Vec<2> area_share(const Vec<2>& a, const Vec<2>& b) { return {(b - a)[1] / 2, -(b - a)[0] / 2}; }
Vec<3> area_share(const Vec<3>& a, const Vec<3>& b, const Vec<3>& c) { return (b - a).cross(c - a) / 6; }

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
      const Vec<Dim> share = std::apply([](const auto&... corner) { return area_share(corner...); }, p);
      for (const int v : facet.vertices) vertex_of<Dim>(expected, v) += 0.3 * 2.5 * share;  // the gradient: minus the force
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

/// An open zigzag of obstacle edges below vertices of bodies, closer than dhat in some places.
struct ContactScene {
  CollisionSurface surface;
  VectorX x;
  ContactScene(unsigned seed, bool convergent) {
    options.enabled = true;
    options.activation_distance = 0.2;
    options.convergent = convergent;
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> noise(-0.04, 0.04);
    const int n = 8;  // two polylines of n vertices, one above the other
    x.resize(4 * n);
    std::vector<Vec<2>> rest;
    std::vector<std::array<int, 2>> edges;
    for (int line = 0; line < 2; ++line)
      for (int i = 0; i < n; ++i) {
        const int v = line * n + i;
        rest.emplace_back(0.3 * i, line);
        x.segment<2>(2 * v) << 0.3 * i + 0.1 * line + noise(random), 0.12 * line + noise(random);
        if (i + 1 < n) edges.push_back({v, v + 1});
      }
    surface = make_collision_surface<2>(edges, {}, {}, rest, std::vector<char>(2 * n, 1));
  }
  ContactOptions options;
};

class Contact : public ::testing::TestWithParam<bool> {};

TEST_P(Contact, DerivativesMatchDifferences) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    const ContactScene scene(seed, GetParam());
    const ContactEnergy<2> contact(scene.surface, scene.options, 3, 0.5);
    Workspace workspace;
    ASSERT_FALSE(contact.active(scene.x, workspace).empty());
    expect_derivatives(contact, scene.x, 1e-7, 1e-5);
    expect_psd(contact, scene.x);
  }
}

TEST_P(Contact, StepIsFreeOfContact) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const ContactScene scene(seed, GetParam());
    const ContactEnergy<2> contact(scene.surface, scene.options, 3, 0.5);
    std::mt19937 random(seed);
    std::normal_distribution<double> normal(0, 0.3);
    const VectorX dx = VectorX::NullaryExpr(scene.x.size(), [&] { return normal(random); });
    Workspace workspace;
    const double step = contact.max_step(scene.x, dx, workspace);
    for (int i = 1; i <= 200; ++i) EXPECT_GT(contact.min_distance(scene.x + step * i / 200.0 * dx, workspace), 0) << seed;
  }
}

INSTANTIATE_TEST_SUITE_P(BothForms, Contact, ::testing::Bool(),
                         [](const auto& info) { return info.param ? "convergent" : "plain"; });

TEST(Friction, DerivativesMatchDifferences) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    ContactScene scene(seed, false);
    scene.options.friction_coefficient = 0.4;
    scene.options.friction_velocity = 0.05;
    const ContactEnergy<2> contact(scene.surface, scene.options, 3, 0.5);
    Workspace workspace;
    std::mt19937 random(seed);
    std::normal_distribution<double> normal(0, 0.001);
    const VectorX reference = scene.x + VectorX::NullaryExpr(scene.x.size(), [&] { return normal(random); });
    const FrictionEnergy<2> friction(contact, scene.x, workspace, scene.options, {20, reference}, 0.01);
    ASSERT_FALSE(friction.empty());
    expect_derivatives(friction, scene.x, 1e-7, 1e-5);
    expect_psd(friction, scene.x);
  }
}

/// A vertex over the middle of a straight line of edges feels it once, wherever the line's vertices are.
TEST(Contact, ConvergentFormCountsOverlappingEdgesOnce) {
  const auto energy_over = [](double corner) {
    const std::vector<Vec<2>> rest = {{0, 0.05}, {-1, 0}, {corner, 0}, {1, 0}};
    CollisionSurface surface = make_collision_surface<2>({{1, 2}, {2, 3}}, {}, std::vector<int>{0}, rest, {1, 0, 0, 0});
    surface.area = {1, 0, 0, 0};  // only the vertex itself carries weight
    ContactOptions options{.enabled = true, .activation_distance = 0.1, .convergent = true};
    VectorX x(8);
    for (int v = 0; v < 4; ++v) x.segment<2>(2 * v) = rest[v];
    Workspace workspace;
    return ContactEnergy<2>(surface, options, 1, 1).value(x, workspace);
  };
  EXPECT_NEAR(energy_over(0.0), energy_over(0.5), 1e-12 * energy_over(0.5));
}

/// Two sheets of triangles, one above the other and turned by `angle`; parallel edges where it is 0.
struct ContactScene3 {
  CollisionSurface surface;
  VectorX x;
  ContactOptions options;
  ContactScene3(unsigned seed, bool convergent, double angle, double roughness) {
    options.enabled = true;
    options.activation_distance = 0.2;
    options.convergent = convergent;
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> noise(-roughness, roughness);
    const int n = 4;
    std::vector<Vec<3>> rest;
    std::vector<std::array<int, 3>> triangles;
    for (int sheet = 0; sheet < 2; ++sheet)
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          const int v = static_cast<int>(rest.size());
          const double c = std::cos(angle * sheet), s = std::sin(angle * sheet), a = 0.3 * i + 0.08 * sheet, b = 0.3 * j;
          rest.emplace_back(c * a - s * b, s * a + c * b, 0.12 * sheet);
          if (i + 1 < n && j + 1 < n) {
            triangles.push_back({v, v + n, v + n + 1});
            triangles.push_back({v, v + n + 1, v + 1});
          }
        }
    x.resize(3 * rest.size());
    for (std::size_t v = 0; v < rest.size(); ++v)
      x.segment<3>(3 * v) = rest[v] + Vec<3>(noise(random), noise(random), noise(random));
    surface = make_collision_surface<3>({}, triangles, {}, rest, std::vector<char>(rest.size(), 1));
  }
};

TEST_P(Contact, DerivativesMatchDifferencesIn3D) {
  int mollified = 0;
  for (unsigned seed = 0; seed < 6; ++seed) {
    const ContactScene3 scene(seed, GetParam(), seed % 2 ? 0.4 : 0, seed % 2 ? 0.03 : 0.003);
    const ContactEnergy<3> contact(scene.surface, scene.options, 3, 0.5);
    Workspace workspace;
    ASSERT_FALSE(contact.active(scene.x, workspace).empty());
    for (const auto& s : contact.active(scene.x, workspace)) mollified += s.is_mollified();
    expect_derivatives(contact, scene.x, 1e-8, 2e-5);
    expect_psd(contact, scene.x);
  }
  EXPECT_GT(mollified, 20);
}

TEST_P(Contact, StepIsFreeOfContactIn3D) {
  for (unsigned seed = 0; seed < 6; ++seed) {
    const ContactScene3 scene(seed, GetParam(), 0.2 * seed, 0.02);
    const ContactEnergy<3> contact(scene.surface, scene.options, 3, 0.5);
    std::mt19937 random(seed);
    std::normal_distribution<double> normal(0, 0.2);
    const VectorX dx = VectorX::NullaryExpr(scene.x.size(), [&] { return normal(random); });
    Workspace workspace;
    const double step = contact.max_step(scene.x, dx, workspace);
    EXPECT_LT(step, 1);
    for (int i = 1; i <= 100; ++i) {
      Workspace fresh;
      EXPECT_GT(contact.min_distance(scene.x + step * i / 100.0 * dx, fresh), 0) << seed;
    }
  }
}

/// The sum by its definition: every pair of primitives, nothing merged, no tree.
double plain_energy(const ContactScene3& scene, const ContactEnergy<3>& contact) {
  double sum = 0;
  const auto& surface = scene.surface;
  const auto at = [&](int v) { return Vec<3>(scene.x.segment<3>(3 * v)); };
  for (const int v : surface.vertices)
    for (const auto& [a, b, c] : surface.triangles)
      if (v != a && v != b && v != c) sum += contact.barrier(point_triangle_distance_squared(at(v), at(a), at(b), at(c)));
  for (std::size_t e = 0; e < surface.edges.size(); ++e)
    for (std::size_t f = e + 1; f < surface.edges.size(); ++f) {
      const auto [a, b] = surface.edges[e];
      const auto [c, d] = surface.edges[f];
      if (a == c || a == d || b == c || b == d) continue;
      const Vec<3> x[] = {at(a), at(b), at(c), at(d)};
      const double s = edge_cross_squared(x);
      const double eps = 1e-3 * surface.edge_length_squared[e] * surface.edge_length_squared[f];
      const double m = s < eps ? (2 - s / eps) * s / eps : 1;
      sum += m * contact.barrier(edge_edge_distance_squared(x[0], x[1], x[2], x[3]));
    }
  return sum;
}

TEST(Contact3, EnergyIsTheSumOverAllPairs) {
  for (unsigned seed = 0; seed < 8; ++seed) {
    const ContactScene3 scene(seed, false, seed % 2 ? 0.3 : 0, seed % 2 ? 0.03 : 0.002);
    const ContactEnergy<3> contact(scene.surface, scene.options, 1, 1);
    Workspace workspace;
    const double expected = plain_energy(scene, contact);
    EXPECT_GT(expected, 0);
    EXPECT_NEAR(contact.value(scene.x, workspace), expected, 1e-12 * expected);
  }
}

/// A vertex over a plane of triangles feels it once, wherever the plane's vertices and edges are.
TEST(Contact3, ConvergentFormCountsOverlappingTrianglesOnce) {
  const auto energy_over = [](double a, double b) {
    const std::vector<Vec<3>> rest = {{0, 0, 0.05}, {-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, {a, b, 0}};
    CollisionSurface surface = make_collision_surface<3>({}, {{1, 2, 5}, {2, 3, 5}, {3, 4, 5}, {4, 1, 5}},
                                                         std::vector<int>{0}, rest, {1, 0, 0, 0, 0, 0});
    surface.area = {1, 0, 0, 0, 0, 0};  // only the vertex itself carries weight
    ContactOptions options{.enabled = true, .activation_distance = 0.1, .convergent = true};
    VectorX x(18);
    for (int v = 0; v < 6; ++v) x.segment<3>(3 * v) = rest[v];
    Workspace workspace;
    return ContactEnergy<3>(surface, options, 1, 1).value(x, workspace);
  };
  const double inside = energy_over(0.5, 0.1);
  EXPECT_GT(inside, 0);
  EXPECT_NEAR(energy_over(0, 0), inside, 1e-12 * inside) << "over a vertex";
  EXPECT_NEAR(energy_over(0.5, 0.5), inside, 1e-12 * inside) << "over an edge";
  EXPECT_NEAR(energy_over(0.02, 0.01), inside, 1e-12 * inside) << "over a triangle, next to a vertex";
}

TEST(Contact3, ObstaclePointsAndEdgesAreFelt) {
  // A body's triangle over a codimensional edge and a codimensional point.
  const std::vector<Vec<3>> rest = {{0, 0, 0.05}, {1, 0, 0.05}, {0, 1, 0.05}, {0.2, -1, 0}, {0.2, 2, 0}, {0.5, 0.25, 0}};
  VectorX x(18);
  for (int v = 0; v < 6; ++v) x.segment<3>(3 * v) = rest[v];
  const ContactOptions options{.enabled = true, .activation_distance = 0.1};
  Workspace workspace;
  const CollisionSurface surface =
      make_collision_surface<3>({{3, 4}}, {{0, 1, 2}}, std::vector<int>{3, 4, 5}, rest, {1, 1, 1, 0, 0, 0});
  const ContactEnergy<3> contact(surface, options, 1, 1);
  int by_point = 0, by_edge = 0;
  for (const auto& s : contact.active(x, workspace)) {
    by_point += s.kind == PairKind::face_vertex && s.vertices[0] == 5;
    by_edge += s.kind == PairKind::edge_edge && s.vertices[2] == 3 && s.vertices[3] == 4;
  }
  EXPECT_EQ(by_point, 1);
  EXPECT_GE(by_edge, 1);
}

TEST(Friction, DerivativesMatchDifferencesIn3D) {
  for (unsigned seed = 0; seed < 4; ++seed) {
    ContactScene3 scene(seed, seed % 2, 0.4, 0.03);
    scene.options.friction_coefficient = 0.4;
    scene.options.friction_velocity = 0.05;
    const ContactEnergy<3> contact(scene.surface, scene.options, 3, 0.5);
    Workspace workspace;
    std::mt19937 random(seed);
    std::normal_distribution<double> normal(0, 0.001);
    const VectorX reference = scene.x + VectorX::NullaryExpr(scene.x.size(), [&] { return normal(random); });
    const FrictionEnergy<3> friction(contact, scene.x, workspace, scene.options, {20, reference}, 0.01);
    ASSERT_FALSE(friction.empty());
    expect_derivatives(friction, scene.x, 1e-7, 1e-5);
    expect_psd(friction, scene.x);
  }
}

TEST(Contact3, HasTheSameBitsForOneAndTwoThreads) {
  const ContactScene3 scene(3, true, 0.3, 0.02);
  const VectorX dx = 0.3 * VectorX::Random(scene.x.size());
  const auto run = [&](int threads) {
    const ThreadLimit limit(threads);
    const ContactEnergy<3> contact(scene.surface, scene.options, 3, 0.5);
    Workspace workspace;
    VectorX result(scene.x.size() + 2);
    result << gradient_of(contact, scene.x), contact.value(scene.x, workspace), contact.max_step(scene.x, dx, workspace);
    return result;
  };
  EXPECT_TRUE((run(1).array() == run(2).array()).all());
}

TEST(AdaptiveStiffness, BalancesTheBarrierAndStaysInItsBounds) {
  const ContactScene3 scene(3, false, 0.3, 0.02);
  Workspace workspace;
  const ContactEnergy<3> contact(scene.surface, scene.options, 1, 1);
  const VectorX barrier = gradient_of(contact, scene.x);
  const double mass = 2, scale = 0.25, Dhat = 0.04;
  const AdaptiveStiffness<3> adaptive(scene.surface, scene.options, mass, scale);
  Vec<3> low = scene.x.head<3>(), high = low;
  for (Eigen::Index i = 0; i < scene.x.size(); i += 3) {
    low = low.cwiseMin(scene.x.segment<3>(i));
    high = high.cwiseMax(scene.x.segment<3>(i));
  }
  const double d0 = std::pow(1e-8 * (high - low).norm(), 2), r = Dhat / d0;
  const double least = 1e11 * mass / (4 * d0 * ((r + 2) * r - 2 * std::log(d0 / Dhat) - 3));
  BarrierStiffness stiffness;
  adaptive.initialize(scene.x, -7 * least * barrier, stiffness, workspace);
  EXPECT_NEAR(stiffness.value * scale, 7 * least, 1e-10 * least);
  EXPECT_NEAR(stiffness.largest * scale, 100 * least, 1e-10 * least);
  adaptive.initialize(scene.x, barrier, stiffness, workspace);  // pulls the same way as the barrier
  EXPECT_NEAR(stiffness.value * scale, least, 1e-10 * least);
  adaptive.initialize(scene.x, -1e9 * least * barrier, stiffness, workspace);
  EXPECT_NEAR(stiffness.value * scale, 100 * least, 1e-8 * least);

  // In the convergent form the force at x is that of the plain one: the energies are made equal there.
  auto options = scene.options;
  options.convergent = true;
  const ContactEnergy<3> convergent(scene.surface, options, 1, 1);
  BarrierStiffness other;
  AdaptiveStiffness<3>(scene.surface, options, mass, scale).initialize(scene.x, -7 * least * barrier, other, workspace);
  EXPECT_NEAR(other.value * convergent.value(scene.x, workspace) * scale, 7 * least * contact.value(scene.x, workspace),
              1e-10 * least * contact.value(scene.x, workspace));
}

TEST(AdaptiveStiffness, DoublesWhileTinyGapsClose) {
  const std::vector<Vec<2>> rest = {{0, 1}, {-1, 0}, {1, 0}};
  const CollisionSurface surface = make_collision_surface<2>({{1, 2}}, {}, std::vector<int>{0}, rest, {1, 0, 0});
  const ContactOptions options{.enabled = true, .activation_distance = 0.1};
  const AdaptiveStiffness<2> adaptive(surface, options, 1, 1);
  Workspace workspace;
  BarrierStiffness stiffness{.value = 1, .largest = 3};
  const auto update = [&](double gap) {
    VectorX x(6);
    x << 0, gap, -1, 0, 1, 0;
    return adaptive.update(x, stiffness, workspace);
  };
  EXPECT_FALSE(update(1e-3));
  EXPECT_FALSE(update(1.5e-9));  // small now, but was large before
  EXPECT_TRUE(update(1e-9));
  EXPECT_EQ(stiffness.value, 2);
  EXPECT_FALSE(update(1.2e-9));  // opening
  EXPECT_TRUE(update(1e-9));
  EXPECT_EQ(stiffness.value, 3);  // the largest
  EXPECT_FALSE(update(0.5e-9));
}

}  // namespace
}  // namespace itr
