// SPDX-License-Identifier: MIT
// A soft square thrown at obstacles, remeshed: nothing intersects, no invalid state goes on.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <string>

#include "core/parallel.hpp"
#include "itr/core.hpp"
#include "itr/solver.hpp"
#include "linear/choice.hpp"
#include "simulation/contact_surface.hpp"
#include "simulation/invariants.hpp"
#include "simulation/step.hpp"
#include "simulation_scenes.hpp"

namespace itr {
namespace {

TEST(Impact, NeverIntersectsWithRemeshing) {
  auto setup = impact();
  setup.time.steps = 30;
  enable_remeshing(setup);
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  double nearest = std::numeric_limits<double>::infinity();
  int accepted = 0;
  while (!simulation.finished()) {
    const auto result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    expect_valid(simulation);
    EXPECT_GT(result.report.min_distance, 0);
    nearest = std::min(nearest, result.report.min_distance);
    accepted += result.report.splits.accepted;
  }
  EXPECT_LT(nearest, 2e-3) << "the square never touched the line";
  EXPECT_GT(accepted, 0);
}

/// A soft square that falls on points: neither an operation nor a relaxation may take a surface over one of them.
TEST(Impact, RemeshingStaysOutsideOfObstaclePoints) {
  auto setup = impact();
  setup.obstacles = {};
  for (int i = 0; i <= 20; ++i) {
    setup.obstacles.rest.emplace_back(-0.1 + 0.4 * i / 20, -0.01);
    setup.obstacles.motion.push_back(kNone);
  }
  setup.contact.convergent = false;
  setup.contact.barrier_stiffness = 1e12;
  setup.mesh = make_square(8, 0.2);
  setup.time.steps = 12;
  enable_remeshing(setup);
  setup.remesh.split.enabled = setup.remesh.swap.enabled = setup.remesh.smooth.enabled = false;
  setup.remesh.collapse.acceptance_tolerance = -0.1;
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  double nearest = std::numeric_limits<double>::infinity();
  int collapses = 0;
  while (!simulation.finished()) {
    const auto result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    expect_valid(simulation);
    for (const VectorX& x : simulation.state().history.x) {
      const auto boundary = body_boundary(simulation.state().mesh, x);
      for (const auto& p : setup.obstacles.rest) ASSERT_EQ(boundary.winding(p), 0) << "step " << simulation.state().step;
    }
    nearest = std::min(nearest, result.report.min_distance);
    collapses += result.report.collapses.accepted;
  }
  EXPECT_LT(nearest, 2e-3) << "the square never touched a point";
  EXPECT_GT(collapses, 0);
}

TEST(Impact, FindsWhatIsWrongWithPositions) {
  auto setup = impact();
  setup.obstacles.rest.emplace_back(0.1, -0.02);  // a point
  setup.obstacles.motion.push_back(kNone);
  const Mesh<2>& mesh = setup.mesh;
  const int bodies = mesh.node_slots();
  VectorX x(2 * (bodies + 3));
  for (int v = 0; v < bodies; ++v) x.segment<2>(2 * v) = mesh.rest(v);
  for (int o = 0; o < 3; ++o) x.segment<2>(2 * (bodies + o)) = setup.obstacles.rest[o];
  const auto with = [&](int vertex, const Vec<2>& p) {
    VectorX changed = x;
    changed.segment<2>(2 * vertex) = p;
    return find_violation(setup, mesh, changed);
  };
  EXPECT_EQ(find_violation(setup, mesh, x), "");
  EXPECT_NE(with(0, {0.3, 0.3}).find("inverted"), std::string::npos);
  EXPECT_EQ(with(bodies, {0, 0.1}), "surfaces intersect");
  EXPECT_EQ(with(bodies + 2, {0.11, 0.12}), "an obstacle is inside of a body");
  EXPECT_EQ(with(bodies + 2, {0.1, 0}), "an obstacle is inside of a body");
  setup.contact.enabled = false;
  EXPECT_EQ(with(bodies, {0, 0.1}), "");
}

TEST(Impact, RefusesToStartInsideOfABody) {
  auto setup = impact();
  linear::Registry registry;
  EXPECT_NO_THROW(Simulation<2>(setup, registry));
  setup.obstacles.rest.emplace_back(0.1, 0.09);
  setup.obstacles.motion.push_back(kNone);
  EXPECT_THROW(Simulation<2>(setup, registry), InputError);
}

TEST(Impact, RefusesSurfacesThatIntersectAtTheStart) {
  auto setup = impact();
  setup.obstacles.rest = {{-1, 0.1}, {1, 0.1}};
  linear::Registry registry;
  EXPECT_THROW(Simulation<2>(setup, registry), InputError);
}

/// A state that the history holds and that is not valid: remeshing carries it along, so the step must notice.
TEST(Impact, KeepsTheMeshWhereARemeshedStateIsNotValid) {
  auto setup = impact();
  setup.time = {.integrator = Integrator::bdf, .bdf_order = 2, .dt = 0.01, .steps = 10};
  enable_remeshing(setup);
  linear::Registry registry;
  const auto splits = [&](bool valid) {
    std::string warnings;
    const Logger logger([&](LogLevel, std::string_view message) { warnings.append(message).append("\n"); });
    Simulation<2> simulation(setup, registry, logger);
    for (int i = 0; i < 2; ++i) EXPECT_TRUE(simulation.advance().ok);
    State<2> state = simulation.state();
    if (!valid) {
      state.history.x[1].tail<4>() << -1, 0.05, 1, 0.05;  // the obstacle, through the body
      EXPECT_THROW(simulation.restore(State<2>(state)), InputError);
    }
    const auto direct = linear::choose_solver(setup.linear, false, registry, logger);
    linear::ReusingSolver solver(*direct);
    ProblemCache<2> cache(solver);
    const auto result = take_step<2>({simulation.setup(), edge_lengths(state.mesh), cache, solver, logger}, state, state);
    EXPECT_TRUE(result.ok) << result.reason;
    EXPECT_EQ(warnings.find("keeping the mesh as it was") == std::string::npos, valid) << warnings;
    EXPECT_EQ(result.report.reverted_remeshes, valid ? 0 : 1);
    return result.report.splits.accepted;
  };
  EXPECT_GT(splits(true), 0);
  EXPECT_EQ(splits(false), 0);
}

/// Corrections of the convergent form have negative weights: its energy is no bound of what splits can gain from it.
TEST(Impact, EnergyOfConvergentContactIsNoBound) {
  const auto tried = [](bool convergent) {
    auto setup = impact();
    setup.contact.convergent = convergent;
    setup.contact.friction_coefficient = 0;
    if (!convergent) setup.contact.barrier_stiffness = 1e9;
    setup.remesh.enabled = true;
    setup.remesh.split.acceptance_tolerance = 1e9;  // nothing has so much energy
    setup.remesh.collapse.enabled = false;
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    int count = 0, in_contact = 0;
    while (!simulation.finished()) {
      const auto result = simulation.advance();
      EXPECT_TRUE(result.ok) << result.reason;
      if (!result.ok) break;
      in_contact += result.report.energy.contact > 0;
      count += result.report.splits.tried;
    }
    EXPECT_GT(in_contact, 0);
    return count;
  };
  EXPECT_GT(tried(true), 0);
  EXPECT_EQ(tried(false), 0);
}

/// The schedule goes on from mesh to mesh, and trials have its stiffness.
TEST(Impact, AdaptiveStiffnessGoesThroughRemeshing) {
  auto setup = impact();
  setup.contact.adaptive_stiffness = true;
  setup.time.steps = 30;
  enable_remeshing(setup);
  const auto run = [&](int threads) {
    const ThreadLimit limit(threads);
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    double nearest = std::numeric_limits<double>::infinity(), stiffest = 0;
    int accepted = 0;
    while (!simulation.finished()) {
      const auto result = simulation.advance();
      EXPECT_TRUE(result.ok) << result.reason;
      if (!result.ok) break;
      expect_valid(simulation);
      nearest = std::min(nearest, result.report.min_distance);
      stiffest = std::max(stiffest, simulation.state().stiffness.value);
      accepted += result.report.splits.accepted + result.report.collapses.accepted;
    }
    EXPECT_LT(nearest, 2e-3) << "the square never touched the line";
    EXPECT_GT(stiffest, simulation.state().stiffness.value) << "it never adapted";
    EXPECT_GT(accepted, 0);
    return simulation.state();
  };
  const State<2> one = run(1), two = run(2);
  EXPECT_TRUE(one.history.x[0].size() == two.history.x[0].size() && one.history.x[0] == two.history.x[0]);
  EXPECT_EQ(one.stiffness.value, two.stiffness.value);
}

}  // namespace
}  // namespace itr
