// SPDX-License-Identifier: MIT
// Statics and creep against closed forms.
#include <gtest/gtest.h>

#include <cmath>

#include "itr/solver.hpp"
#include "simulation/step_problem.hpp"
#include "simulation_scenes.hpp"

namespace itr {
namespace {

/// Held in x on the left and in y at the bottom: free to stretch, not to move.
Setup<2> symmetric_square(int n) {
  auto setup = free_square(n);
  const auto zero = [](const Vec<2>&, double) { return Vec<2>(0, 0); };
  setup.dirichlet.push_back({1, {true, false}, zero});
  setup.dirichlet.push_back({2, {false, true}, zero});
  setup.newton.step_tolerance = 0;
  setup.newton.gradient_tolerance = setup.newton.first_gradient_tolerance = 1e-11;
  return setup;
}

TEST(Statics, PressureReachesTheUniformStretchOfTheClosedForm) {
  const double p = 4000;
  auto setup = symmetric_square(3);
  setup.time = {.is_static = true};
  for (const int tag : {3, 4}) setup.pressure.push_back({tag, [p](const Vec<2>&, double) { return p; }});
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const auto result = simulation.advance();
  ASSERT_TRUE(result.ok) << result.reason;
  EXPECT_TRUE(simulation.finished());
  // F = s I: the first Piola-Kirchhoff stress mu (s - 1/s) + 2 lambda ln(s) / s is -p J F^-T = -p s.
  const double mu = setup.materials[1].lame_mu(), lambda = setup.materials[1].lame_lambda(2);
  double low = 0.2, high = 1;
  for (int i = 0; i < 60; ++i) {
    const double s = (low + high) / 2;
    (mu * (s - 1 / s) + 2 * lambda * std::log(s) / s + p * s > 0 ? high : low) = s;
  }
  EXPECT_LT(low, 0.9);
  const auto& state = simulation.state();
  for (int v = 0; v < state.mesh.num_vertices(); ++v)
    EXPECT_LE((state.history.x[0].segment<2>(2 * v) - low * state.mesh.rest(v)).norm(), 1e-9);
}

TEST(Statics, DampingCreepsAsKelvinAndVoigtSay) {
  const double beta = 0.03, h = 0.01;
  auto setup = symmetric_square(2);
  setup.materials[1].law = MaterialLaw::linear;
  setup.neumann.push_back({3, [](const Vec<2>&, double) { return Vec<2>(50, 0); }});
  auto elastic = setup;
  elastic.time = {.is_static = true};
  setup.time = {.quasistatic = true, .dt = h, .steps = 10};
  setup.damping.push_back({.coefficient = beta});
  linear::Registry registry;
  Simulation<2> limit(elastic, registry), creeping(setup, registry);
  ASSERT_TRUE(limit.advance().ok);
  const VectorX rest = creeping.state().history.x[0], end = limit.state().history.x[0] - rest;
  for (int k = 1; k <= 10; ++k) {
    const auto result = creeping.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    EXPECT_GT(result.report.energy.damping, 0);
    const VectorX expected = (1 - std::pow(1 + h / beta, -k)) * end;  // of implicit Euler
    EXPECT_LE((creeping.state().history.x[0] - rest - expected).norm(), 1e-9 * end.norm()) << "step " << k;
  }
}

TEST(Statics, QuasistaticStepsBeginWhereTheMotionGoesOn) {
  auto setup = symmetric_square(3);
  setup.newton.gradient_tolerance = setup.newton.first_gradient_tolerance = 0;
  setup.materials[1].law = MaterialLaw::linear;
  setup.dirichlet.push_back({3, {true, false}, [](const Vec<2>&, double t) { return Vec<2>(std::min(t, 0.08 - t), 0); }});
  setup.time = {.quasistatic = true, .dt = 0.01, .steps = 6};
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  // A linear body follows its prescribed motion until that turns back.
  for (const bool is_new : {true, false, false, false, true, false}) {
    const auto result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    EXPECT_EQ(result.report.newton_iterations > 0, is_new) << "t " << simulation.state().t;
  }
}

TEST(Statics, ContactCarriesTheLoad) {
  auto setup = symmetric_square(4);
  setup.time = {.is_static = true};
  setup.dirichlet.pop_back();  // the bottom rests on an obstacle instead
  setup.obstacles.rest = {{-1, -0.001}, {1, -0.001}};
  setup.obstacles.edges = {{0, 1}};
  setup.obstacles.motion = {kNone, kNone};
  setup.contact = {.enabled = true, .dhat = 2e-3, .convergent = true, .barrier_stiffness = 1e5};
  setup.body_acceleration = [](const Vec<2>&, double) { return Vec<2>(0, -10); };
  setup.newton.gradient_tolerance = 1e-8;
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const auto result = simulation.advance();
  ASSERT_TRUE(result.ok) << result.reason;
  EXPECT_GT(result.report.min_distance, 0);
  EXPECT_LT(result.report.min_distance, 2e-3);
  // The barrier's forces on the obstacle sum to the weight, 1000 kg/m^2 * 0.04 m^2 * 10 m/s^2.
  const auto& state = simulation.state();
  const CollisionSurface surface = collision_surface(state.mesh, setup.obstacles);
  Workspace workspace;
  VectorX gradient = VectorX::Zero(state.history.x[0].size());
  ContactEnergy<2>(surface, setup.contact, setup.contact.barrier_stiffness, 1)
      .add_gradient(state.history.x[0], gradient, workspace);
  const int bodies = state.mesh.num_vertices();
  EXPECT_NEAR(-(gradient[2 * bodies + 1] + gradient[2 * bodies + 3]), -400, 1e-5);
}

}  // namespace
}  // namespace itr
