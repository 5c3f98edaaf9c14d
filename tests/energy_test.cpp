// SPDX-License-Identifier: MIT
// Derivatives of every term against central differences, and what projected Hessians promise.
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>
#include <random>

#include "itr/energy/contact/friction.hpp"
#include "itr/energy/elastic/elastic.hpp"
#include "itr/energy/inertia.hpp"
#include "itr/energy/load.hpp"
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
    surface.area.assign(2 * n, 0.5);
    surface.degree.assign(2 * n, 2);
    surface.counts.assign(2 * n, 1);
    for (int line = 0; line < 2; ++line)
      for (int i = 0; i < n; ++i) {
        const int v = line * n + i;
        x.segment<2>(2 * v) << 0.3 * i + 0.1 * line + noise(random), 0.12 * line + noise(random);
        surface.vertices.push_back(v);
        if (i == 0 || i == n - 1) surface.degree[v] = 1;
        if (i + 1 < n) surface.edges.push_back({v, v + 1});
      }
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
    CollisionSurface surface;
    surface.vertices = {0, 1, 2, 3};
    surface.edges = {{1, 2}, {2, 3}};
    surface.area = {1, 0, 0, 0};  // only the vertex itself carries weight
    surface.degree = {0, 1, 2, 1};
    surface.counts = {1, 0, 0, 0};
    ContactOptions options{.enabled = true, .activation_distance = 0.1, .convergent = true};
    VectorX x(8);
    x << 0, 0.05, -1, 0, corner, 0, 1, 0;
    Workspace workspace;
    return ContactEnergy<2>(surface, options, 1, 1).value(x, workspace);
  };
  EXPECT_NEAR(energy_over(0.0), energy_over(0.5), 1e-12 * energy_over(0.5));
}

}  // namespace
}  // namespace itr
