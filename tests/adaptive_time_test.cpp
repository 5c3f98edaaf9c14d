// SPDX-License-Identifier: MIT
// Steps that choose their lengths: the tolerance is reached, impacts keep their energy, nothing depends on luck.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "advance.hpp"
#include "itr/core.hpp"
#include "itr/solver.hpp"
#include "simulation_scenes.hpp"

namespace itr {
namespace {

void make_adaptive(Setup<2>& setup, Integrator integrator, double tolerance, double end) {
  setup.time = {.integrator = integrator, .dt = end / 1000, .steps = 1000};
  setup.time.adaptive = {.enabled = true, .tolerance = tolerance, .dt_min = 1e-7 * end, .dt_max = end / 10, .end = end};
}

/// A square, held at one side and let go from a stretched state.
Setup<2> swinging_square() {
  auto setup = free_square(2);
  setup.materials[1] = {.youngs_modulus = 1e5, .poisson_ratio = 0.3, .density = 1000};
  setup.initial_displacement.push_back({1, [](const Vec<2>& X, double) { return Vec<2>(0.05 * X[0], 0.02 * X[0]); }});
  setup.dirichlet.push_back({1, {true, true}, [](const RestPoint<2>&, double) { return Vec<2>::Zero().eval(); }});
  return setup;
}

struct Outcome {
  VectorX x, v;
  int steps = 0, rejected = 0;
  double error = 0;  ///< the estimates of all steps
  std::vector<double> times;
};
Outcome run(Setup<2> setup) {
  linear::Registry registry;
  Simulation<2> simulation(std::move(setup), registry);
  Outcome run;
  while (!simulation.finished()) {
    const StepResult result = advance(simulation);
    run.error += result.report.time_error;
    run.rejected += result.report.rejected_steps;
    EXPECT_EQ(result.report.rejections.size(), static_cast<std::size_t>(result.report.rejected_steps));
    run.times.push_back(simulation.time());
  }
  run.x = simulation.positions();
  run.v = simulation.velocities();
  run.steps = simulation.steps();
  return run;
}

TEST(AdaptiveTime, ErrorFollowsTheToleranceAndTheEstimate) {
  constexpr double kEnd = 0.1;  // about two periods of the slowest swing
  auto reference = swinging_square();
  reference.time = {.integrator = Integrator::bdf, .dt = kEnd / 2000, .steps = 2000};
  const Outcome exact = run(reference);
  const double amplitude = (exact.x - run([] {
                                        auto setup = swinging_square();
                                        setup.time = {.integrator = Integrator::bdf, .dt = 1e-9, .steps = 1};
                                        return setup;
                                      }())
                                          .x)
                               .norm();
  std::vector<double> errors;
  for (const double tolerance : {0.08, 0.02, 0.005}) {
    auto setup = swinging_square();
    make_adaptive(setup, Integrator::bdf, tolerance, kEnd);
    const Outcome adaptive = run(setup);
    errors.push_back((adaptive.x - exact.x).norm() / amplitude);
    EXPECT_EQ(adaptive.times.back(), kEnd);
    EXPECT_LT(errors.back(), adaptive.error) << "at " << tolerance << " by " << adaptive.steps << " steps";
    EXPECT_GT(errors.back(), adaptive.error / 10) << "at " << tolerance << " by " << adaptive.steps << " steps";
  }
  EXPECT_GT(errors[0] / errors[2], 6);
}

/// A program's steps have the lengths that it asks for.
TEST(AdaptiveTime, LeavesAProgramItsSteps) {
  auto setup = swinging_square();
  make_adaptive(setup, Integrator::bdf, 1e-4, 0.1);
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  advance(simulation);
  const double t = simulation.time();
  for (int k = 1; k <= 3; ++k) {
    const StepResult result = simulation.advance(0.02);
    ASSERT_TRUE(result.ok);
    EXPECT_EQ(result.report.rejected_steps, 0);
    EXPECT_NEAR(simulation.time(), t + 0.02 * k, 1e-15);
  }
  const StepResult result = advance(simulation);
  EXPECT_GT(result.report.dt, 0);
  EXPECT_LT(result.report.dt, 0.01) << "chosen by the error again";
}

TEST(AdaptiveTime, StepsAfterRestoreHaveTheSameBits) {
  auto setup = impact();
  setup.contact.friction_coefficient = 0;
  make_adaptive(setup, Integrator::bdf, 0.2, 0.012);
  enable_remeshing(setup);
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  Snapshot<2> saved;
  std::vector<StepReport> first;
  while (!simulation.finished()) {
    if (simulation.steps() == 8) saved = simulation.save();
    const StepResult result = advance(simulation);
    expect_valid(simulation);
    if (saved.state) first.push_back(result.report);
  }
  ASSERT_GT(first.size(), 3u);
  const VectorX x = simulation.positions();
  simulation.restore(saved);
  for (const StepReport& report : first) {
    const StepResult result = advance(simulation);
    ASSERT_EQ(result.report.t, report.t);
    EXPECT_EQ(result.report.dt, report.dt);
    EXPECT_EQ(result.report.time_error, report.time_error);
    EXPECT_EQ(result.report.rejected_steps, report.rejected_steps);
  }
  EXPECT_EQ(VectorX(simulation.positions()), x);
}

TEST(AdaptiveTime, EndsStepsAtKinksAndAtAskedTimes) {
  auto setup = swinging_square();
  make_adaptive(setup, Integrator::newmark, 0.05, 0.1);
  setup.time.adaptive.output_dt = 0.03;
  setup.time.adaptive.kinks = {0.0123, 0.05};
  const Outcome found = run(setup);
  const std::set<double> times(found.times.begin(), found.times.end());
  for (const double t : {0.0123, 0.05, 1 * 0.03, 2 * 0.03, 3 * 0.03, 0.1}) EXPECT_TRUE(times.count(t)) << t;
}

TEST(AdaptiveTime, StepsThatWereShortenedHaveErrorBarsToo) {
  auto setup = swinging_square();
  make_adaptive(setup, Integrator::bdf, 0.1, 0.02);
  setup.time.dt = 0.002;
  setup.fields.error_bars = true;
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  int rejected = 0;
  while (!simulation.finished()) {
    const StepResult result = advance(simulation);
    rejected += result.report.rejected_steps;
    EXPECT_TRUE(result.report.errors.is_asked) << result.report.step;
    EXPECT_EQ(result.report.errors.no_bar, "") << result.report.step;
    EXPECT_EQ(result.errors.sources.size(), static_cast<std::size_t>(kErrorSources)) << result.report.step;
  }
  EXPECT_GT(rejected, 0);
}

/// The part of its kinetic energy that a block keeps after it has hit a wall and left it again, by where it starts.
double energy_after_bounce(double gap, double tolerance) {
  auto setup = free_square(3);
  setup.materials[1] = {.youngs_modulus = 1e6, .poisson_ratio = 0, .density = 1000};
  setup.obstacles.rest = {{-1, -gap}, {1, -gap}};
  setup.obstacles.edges = {{0, 1}};
  setup.obstacles.motion = {kNone, kNone};
  setup.contact = {.enabled = true, .dhat = 1e-3, .convergent = true, .barrier_stiffness = 1e5};
  setup.initial_velocity.push_back({1, [](const Vec<2>&, double) { return Vec<2>(0, -1); }});
  make_adaptive(setup, Integrator::bdf, tolerance, 0.04);  // waves take 0.0063 s to and fro
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  while (!simulation.finished()) {
    const StepResult result = advance(simulation);
  }
  EXPECT_EQ(simulation.report().energy.contact, 0) << "it has left the wall";
  const State<2>& state = simulation.state();
  double kinetic = 0;
  const VectorX& v = state.history.v[0];
  for (const CellId c : state.mesh.live_cells()) {
    const auto& cell = state.mesh.cell(c);
    Vec<2> sum = Vec<2>::Zero();
    double squares = 0;
    for (const VertexId vertex : cell) {
      const Vec<2> at = v.segment<2>(2 * vertex);
      sum += at;
      squares += at.squaredNorm();
    }
    kinetic += 1000 * state.mesh.volume(c) / 12 * (squares + sum.squaredNorm()) / 2;
  }
  return (kinetic + simulation.report().energy.elastic) / (0.5 * 1000 * 0.04);
}

TEST(AdaptiveTime, AnImpactKeepsItsEnergyWhereverItFallsInAStep) {
  double least = 2, most = 0;
  for (int i = 0; i < 8; ++i) {
    const double kept = energy_after_bounce(0.005 * (1 + i / 8.0), 0.01);
    least = std::min(least, kept);
    most = std::max(most, kept);
  }
  EXPECT_GT(least, 0.93) << "BDF2 damps the waves that the impact leaves";
  EXPECT_LT(most, 1);
  EXPECT_LT(most - least, 0.005);
}

}  // namespace
}  // namespace itr
