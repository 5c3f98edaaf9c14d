// SPDX-License-Identifier: MIT
// Held vertices arrive exactly, or the step ends with the reason.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "itr/solver.hpp"
#include "simulation_scenes.hpp"

namespace itr {
namespace {

TEST(HeldVertices, AreExactAtTheEndOfEachStep) {
  auto setup = free_square(3);
  setup.time.quasistatic = true;
  const auto pull = [](const Vec<2>& X, double t) { return Vec<2>(0.3 * X[1] * t, 2 * t); };
  setup.dirichlet.push_back({4, {true, true}, pull});
  setup.dirichlet.push_back({2, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }});
  enable_remeshing(setup);
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  while (!simulation.finished()) {
    const auto result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    const auto& state = simulation.state();
    for (int f = 0; f < state.mesh.facet_slots(); ++f)
      if (state.mesh.facet_tag(f) == 4)
        for (const int v : state.mesh.facet(f)) {
          const Vec<2> target = state.mesh.rest(v) + pull(state.mesh.rest(v), state.t);
          EXPECT_EQ(state.history.x[0][2 * v], target[0]);
          EXPECT_EQ(state.history.x[0][2 * v + 1], target[1]);
        }
  }
}

TEST(HeldVertices, MayMoveByLessThanRoundOff) {
  auto setup = free_square(3);
  setup.newton.first_gradient_tolerance = setup.newton.gradient_tolerance = 1e-300;
  setup.newton.step_tolerance = 1e-11;
  setup.time = {.dt = 0.0025, .steps = 3};
  setup.dirichlet.push_back(
      {1, {true, true}, [](const Vec<2>& X, double t) { return Vec<2>(std::pow(3 * t, 8) * (X[0] + 0.2 * X[1]), 0); }});
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  while (!simulation.finished()) {
    const auto result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
  }
}

/// The square on a line, its upper side moved down by `depth` in one step.
Setup<2> pressed_square(double depth) {
  auto setup = impact();
  setup.initial_velocity.clear();
  setup.time.steps = 1;
  setup.dirichlet.push_back({4, {true, true}, [depth](const Vec<2>&, double) { return Vec<2>(0, -depth); }});
  return setup;
}

TEST(HeldVertices, ArriveWhereOnlyTheWayIsBlocked) {
  linear::Registry registry;
  Simulation<2> simulation(pressed_square(0.1), registry);
  const auto result = simulation.advance();
  ASSERT_TRUE(result.ok) << result.reason;
  expect_valid(simulation);
  const auto& state = simulation.state();
  for (int f = 0; f < state.mesh.facet_slots(); ++f)
    if (state.mesh.facet_tag(f) == 4) {
      for (const int v : state.mesh.facet(f)) EXPECT_EQ(state.history.x[0][2 * v + 1], state.mesh.rest(v)[1] - 0.1);
    }
}

TEST(HeldVertices, ThatCannotArriveEndTheStepWithTheReason) {
  linear::Registry registry;
  for (const int cuts : {0, 3}) {
    auto setup = pressed_square(0.3);  // below the line
    setup.time.step_cuts = cuts;
    Simulation<2> simulation(setup, registry);
    const VectorX start = simulation.state().history.x[0];
    const auto result = simulation.advance();
    ASSERT_FALSE(result.ok);
    EXPECT_NE(result.reason.find("held vertices"), std::string::npos) << "reason: " << result.reason;
    // In the way are the line below the square and what it squeezes together: a pair limits a step, or no step is left.
    EXPECT_TRUE(result.reason.find("limited by the vertex-edge pair ") != std::string::npos ||
                result.reason.find("its contact pair ") != std::string::npos)
        << result.reason;
    for (const char* part : {" near (", "the largest residual, "})
      EXPECT_NE(result.reason.find(part), std::string::npos) << part << "; reason: " << result.reason;
    EXPECT_EQ(simulation.state().step, 0);
    EXPECT_EQ(simulation.state().history.x[0], start);
  }
}

/// The line reaches far to one side: the mean of its ends and the vertex is nowhere near the contact.
TEST(HeldVertices, TheReasonNamesThePlaceOfAContact) {
  linear::Registry registry;
  auto setup = pressed_square(0.3);
  setup.obstacles.rest[1][0] *= 100;
  const auto result = Simulation<2>(setup, registry).advance();
  ASSERT_FALSE(result.ok);
  const auto at = result.reason.find("obstacle 1 near (");
  ASSERT_NE(at, std::string::npos) << result.reason;
  EXPECT_LT(std::abs(std::stod(result.reason.substr(at + 17))), 0.21) << result.reason;
}

TEST(HeldVertices, TheReasonNamesVerticesOfAProxy) {
  linear::Registry registry;
  auto setup = pressed_square(0.3);
  const auto vertices = static_cast<Eigen::Index>(setup.mesh.num_vertices());
  CollisionProxy<2> proxy{{}, {}, {}, {vertices, vertices}};
  proxy.weights.setIdentity();
  for (int v = 0; v < vertices; ++v) proxy.rest.push_back(setup.mesh.rest(v));
  for (int f = 0; f < setup.mesh.facet_slots(); ++f) proxy.edges.push_back(setup.mesh.facet(f));
  setup.proxy = proxy;
  const auto result = Simulation<2>(setup, registry).advance();
  ASSERT_FALSE(result.ok);
  for (const char* part : {"its contact pair proxy ", " near ("})
    EXPECT_NE(result.reason.find(part), std::string::npos) << part << "; reason: " << result.reason;
}

}  // namespace
}  // namespace itr
