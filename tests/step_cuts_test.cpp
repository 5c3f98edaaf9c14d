// SPDX-License-Identifier: MIT
// Steps that fail whole go on in parts.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "itr/solver.hpp"
#include "simulation_scenes.hpp"

namespace itr {
namespace {

/// The impact, stopped after so few Newton iterations that whole steps fail at first contact.
Setup<2> hurried_impact(TimeOptions time) {
  auto setup = impact();
  setup.time = time;
  setup.time.dt = 0.01;
  setup.time.steps = 6;
  setup.newton.max_iterations = 5;
  return setup;
}

/// Order of the integrator that takes the `count`th step after BDF has begun or a step was cut.
int order_after(const TimeOptions& time, int count) {
  if (time.integrator == Integrator::newmark) return 2;
  return time.integrator == Integrator::bdf ? std::min(count, time.bdf_order) : 1;
}

class StepCuts : public ::testing::TestWithParam<TimeOptions> {};

TEST_P(StepCuts, GoOnWhereWholeStepsFailAndSayThatTheyDid) {
  linear::Registry registry;
  auto setup = hurried_impact(GetParam());
  Simulation<2> whole(setup, registry);
  StepResult result;
  while (result.ok && !whole.finished()) result = whole.advance();
  ASSERT_FALSE(result.ok);
  EXPECT_EQ(whole.state().history.x.size(),
            static_cast<std::size_t>(std::min(whole.state().step + 1, GetParam().integrator == Integrator::bdf ? 2 : 1)));

  setup.time.step_cuts = 12;
  int warnings = 0;
  Simulation<2> parts(setup, registry, Logger([&](LogLevel level, std::string_view text) {
                        warnings += level == LogLevel::warning && text.find("cutting") != text.npos;
                      }));
  int cut = 0, since = 0;
  while (!parts.finished()) {
    result = parts.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    const bool is_cut = result.report.cut_steps > 0;
    cut += is_cut;
    since = is_cut ? 0 : since + 1;
    EXPECT_EQ(result.report.order, is_cut ? 1 : order_after(GetParam(), since));
    EXPECT_EQ(result.report.step, parts.state().step);
    EXPECT_EQ(parts.state().t, 0.01 * parts.state().step);
    expect_valid(parts);
  }
  EXPECT_GE(cut, 1);
  EXPECT_GE(warnings, cut);
}

TEST(Order, BeginsWith1AgainWhenTheStepChanges) {
  linear::Registry registry;
  auto setup = free_square(2);
  setup.time = {.integrator = Integrator::bdf, .bdf_order = 3, .dt = 0.01, .steps = 20};
  Simulation<2> simulation(setup, registry);
  EXPECT_EQ(simulation.report().order, 0);  // no step yet
  std::vector<int> orders;
  for (const double dt : {0.01, 0.01, 0.01, 0.01, 0.02, 0.02, 0.02, 0.02})
    orders.push_back(simulation.advance(dt).report.order);
  EXPECT_EQ(orders, (std::vector<int>{1, 2, 3, 3, 1, 2, 3, 3}));
}

INSTANTIATE_TEST_SUITE_P(All, StepCuts,
                         ::testing::Values(TimeOptions{.integrator = Integrator::implicit_euler},
                                           TimeOptions{.integrator = Integrator::newmark},
                                           TimeOptions{.integrator = Integrator::bdf, .bdf_order = 2}),
                         ::testing::PrintToStringParamName());

TEST(StaticCuts, AreSmallerLoads) {
  auto setup = free_square(3);
  setup.time = {.is_static = true, .step_cuts = 6};
  setup.dirichlet.push_back({2, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }});
  setup.dirichlet.push_back({4, {true, true}, [](const Vec<2>&, double t) { return Vec<2>(0.2 * t, 0.05 * t); }});
  setup.newton.step_tolerance = 1e-9;
  setup.newton.max_iterations = 4;
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const auto result = simulation.advance();
  ASSERT_TRUE(result.ok) << result.reason;
  EXPECT_TRUE(simulation.finished());
  EXPECT_GE(result.report.cut_steps, 2);
  EXPECT_EQ(result.report.order, 0);
  EXPECT_EQ(simulation.state().t, 1);
  for (int f = 0; f < simulation.state().mesh.facet_slots(); ++f) {
    if (simulation.state().mesh.facet_tag(f) != 4) continue;
    for (const int v : simulation.state().mesh.facet(f))
      EXPECT_EQ(simulation.state().history.x[0][2 * v], simulation.state().mesh.rest(v)[0] + 0.2);
  }
}

}  // namespace
}  // namespace itr
