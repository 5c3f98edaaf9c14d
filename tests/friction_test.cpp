// SPDX-License-Identifier: MIT
// Friction: derivatives, Hessians of primal-dual solves, relaxation.
#include "energy/contact/friction.hpp"

#include <gtest/gtest.h>

#include <random>

#include "contact_scenes.hpp"
#include "derivatives.hpp"

namespace itr {
namespace {

/// Friction of a pair of sheets or lines that slip slowly, lagged where the scene is, from `reference`.
template <int Dim, typename Scene>
FrictionEnergy<Dim> friction_of(Scene& scene, const VectorX& reference) {
  scene.options.friction_coefficient = 0.4;
  scene.options.friction_velocity = 0.05;
  const ContactEnergy<Dim> contact(scene.surface, scene.options, 3, 0.5);
  Workspace workspace;
  return FrictionEnergy<Dim>(contact, scene.x, workspace, scene.options, {20, reference}, 0.01);
}

VectorX near(const VectorX& x, double deviation, std::mt19937& random) {
  std::normal_distribution<double> normal(0, deviation);
  return x + VectorX::NullaryExpr(x.size(), [&] { return normal(random); });
}

template <int Dim, typename Scene>
void expect_friction_derivatives(Scene scene, unsigned seed) {
  std::mt19937 random(seed);
  const FrictionEnergy<Dim> friction = friction_of<Dim>(scene, near(scene.x, 0.001, random));
  ASSERT_FALSE(friction.empty());
  expect_derivatives(friction, scene.x, 1e-7, 1e-5);
  expect_psd(friction, scene.x);
}

TEST(Friction, DerivativesMatchDifferences) {
  for (unsigned seed = 0; seed < 10; ++seed) expect_friction_derivatives<2>(ContactScene(seed, false), seed);
  for (unsigned seed = 0; seed < 4; ++seed) expect_friction_derivatives<3>(ContactScene3(seed, seed % 2, 0.4, 0.03), seed);
}

/// Hessians of a solve that is primal-dual in friction: the true one where forces are those of the slip, and one without
/// negative eigenvalues on the way from one slip to another.
template <int Dim, typename Scene>
void expect_primal_dual_hessians(Scene scene, unsigned seed) {
  std::mt19937 random(seed);
  const VectorX reference = near(scene.x, 0.003, random), next = near(scene.x, 0.003, random);
  FrictionEnergy<Dim> friction = friction_of<Dim>(scene, reference);
  const auto hessian = [&] { return hessian_of(friction, scene.x, PsdProjection::none); };
  const MatrixX plain = hessian();
  friction.begin_solve(scene.x, true);
  EXPECT_LE((hessian() - plain).norm(), 1e-12 * plain.norm());
  friction.begin_solve(scene.x, false);
  EXPECT_GT((hessian() - plain).norm(), 0.01 * plain.norm());
  expect_psd(friction, scene.x);
  for (const double fraction : {0.3, 1.0}) {
    friction.follow(next, fraction);
    expect_psd(friction, next);
  }
}

TEST(Friction, PrimalDualHessiansAreTrueAtTheEndAndNeverIndefinite) {
  for (unsigned seed = 0; seed < 10; ++seed) expect_primal_dual_hessians<2>(ContactScene(seed, false), seed);
  for (unsigned seed = 0; seed < 4; ++seed) expect_primal_dual_hessians<3>(ContactScene3(seed, seed % 2, 0.4, 0.03), seed);
}

/// A vertex has come down upon another one and stands a little beside it, so that their tangent is tilted.
TEST(Friction, CountsNoApproachAsSlip) {
  constexpr double kGap = 0.1, kBeside = 0.02, kDhat = 0.2;
  const ContactOptions options{
      .enabled = true, .dhat = kDhat, .friction_coefficient = 0.4, .friction_velocity = 5};  // m/s: nothing slides
  VectorX x(12), lift = VectorX::Zero(12);
  x << -0.3, -0.2, 0, 0, 0.3, -0.2, kBeside - 0.3, kGap + 0.2, kBeside, kGap, kBeside + 0.3, kGap + 0.2;
  lift.tail(6) << 0, 1, 0, 1, 0, 1;
  std::vector<Vec<2>> rest;
  for (Eigen::Index v = 0; v < 6; ++v) rest.emplace_back(x.segment<2>(2 * v));
  const CollisionSurface surface =
      make_collision_surface<2>({{0, 1}, {1, 2}, {3, 4}, {4, 5}}, {}, {}, rest, std::vector<char>(6, 1));
  const ContactEnergy<2> contact(surface, options, 3, 0.5);
  Workspace workspace;
  const auto force_after_fall = [&](double height, bool slips_from_touch) {
    VectorX reference = x + height * lift;
    for (Eigen::Index v = 3; v < 6; ++v) reference[2 * v] -= kBeside;
    FrictionEnergy<2> friction;
    friction.renew(contact, x, workspace, options, 20, reference, 0.01, slips_from_touch);
    EXPECT_FALSE(friction.empty());
    return gradient_of(friction, x);
  };
  const VectorX force = force_after_fall(kDhat - kGap, false);
  EXPECT_GT(force.norm(), 0);
  for (const double height : {kDhat - kGap, 1.0, 10.0})
    EXPECT_LE((force_after_fall(height, true) - force).norm(), 1e-12 * force.norm()) << height;
  EXPECT_GT((force_after_fall(1, false) - force).norm(), 0.5 * force.norm());

  const auto force_after_slide = [&](bool slips_from_touch) {
    VectorX reference = x;
    for (Eigen::Index v = 3; v < 6; ++v) reference[2 * v] -= 10 * kDhat;
    FrictionEnergy<2> friction;
    friction.renew(contact, x, workspace, options, 20, reference, 0.01, slips_from_touch);
    return gradient_of(friction, x);
  };
  EXPECT_EQ(force_after_slide(true), force_after_slide(false)) << "from beside";
}

TEST(Friction, RelaxedForcesLieOnTheLineBetweenTwo) {
  ContactScene scene(1, false);
  scene.options.friction_coefficient = 0.4;
  Workspace workspace;
  const VectorX reference = scene.x.array() + 0.001 * VectorX::LinSpaced(scene.x.size(), 0, 1).array();
  const ContactEnergy<2> soft(scene.surface, scene.options, 3, 0.5), stiff(scene.surface, scene.options, 7, 0.5);
  VectorX apart = scene.x;
  for (Eigen::Index i = apart.size() / 2; i < apart.size(); ++i) apart[i] += 1;
  const auto lagged = [&](const ContactEnergy<2>& contact, const VectorX& x) {
    return FrictionEnergy<2>(contact, x, workspace, scene.options, {20, reference}, 0.01);
  };
  const FrictionEnergy<2> before = lagged(soft, scene.x), after = lagged(stiff, scene.x), none = lagged(soft, apart);
  ASSERT_TRUE(none.empty());
  const VectorX a = gradient_of(before, scene.x), b = gradient_of(after, scene.x);
  for (const double factor : {0.25, 1.0, 1.5}) {
    FrictionEnergy<2> relaxed = after;
    relaxed.relax(before, factor);
    EXPECT_LE((gradient_of(relaxed, scene.x) - (a + factor * (b - a))).norm(), 1e-12 * b.norm()) << factor;
  }
  FrictionEnergy<2> begun = after, ended = none;
  begun.relax(none, 0.25);
  EXPECT_LE((gradient_of(begun, scene.x) - 0.25 * b).norm(), 1e-12 * b.norm());
  ended.relax(before, 0.25);
  EXPECT_LE((gradient_of(ended, scene.x) - 0.75 * a).norm(), 1e-12 * a.norm());
}

}  // namespace
}  // namespace itr
