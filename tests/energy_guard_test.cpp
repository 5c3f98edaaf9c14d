// SPDX-License-Identifier: MIT
// Newmark's energy guard: it stops energy that the rule creates, and nothing else.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <string>

#include "itr/solver.hpp"
#include "simulation/state.hpp"
#include "simulation/step_problem.hpp"
#include "square_mesh.hpp"

namespace itr {
namespace {

constexpr double kSize = 0.2;

/// A soft square at rest over a line, by the trapezoidal rule.
Setup<2> square_over_line() {
  const Grid grid = make_regular_grid(4, kSize, [](int i, int j) { return (i + j) % 2; });
  Setup<2> setup;
  setup.mesh = Mesh<2>(grid.rest, grid.cells, std::vector<int>(grid.cells.size(), 1));
  tag_sides(setup.mesh, kSize);
  setup.materials[1] = {.youngs_modulus = 1e4, .poisson_ratio = 0.4, .density = 1000};
  setup.time = {.integrator = Integrator::newmark, .dt = 0.005, .steps = 40};
  setup.newton.step_tolerance = 1e-7;
  setup.newton.gradient_tolerance = setup.newton.first_gradient_tolerance = 1e-10;
  setup.obstacles.rest = {{-1, -0.01}, {1, -0.011}};
  setup.obstacles.edges = {{0, 1}};
  setup.obstacles.motion = {kNone, kNone};
  setup.contact = {.enabled = true, .dhat = 2e-3, .convergent = true, .barrier_stiffness = 1e4};
  return setup;
}

/// Waves travel at 4.6 m/s.
Setup<2> supersonic_impact(double energy_growth_limit) {
  auto setup = square_over_line();
  setup.time.energy_growth_limit = energy_growth_limit;
  setup.time.dt = 5e-4;
  setup.time.steps = 60;
  setup.initial_velocity = {{1, [](const Vec<2>&, double) { return Vec<2>(0, -12); }}};
  return setup;
}

struct Energies {
  double growth = 1;  ///< largest mechanical energy, relative to that at the start
  int damped_steps = 0;
  bool ok = true;
};

Energies simulate(const Setup<2>& setup) {
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const auto solver = registry.create("eigen");
  const auto energy = [&] {
    const State<2>& state = simulation.state();
    ProblemCache<2> cache(*solver);
    StepProblem<2> problem(setup, state.mesh, state.history, state.t, cache);
    return problem.mechanical_energy(state.history.x[0], state.history.v[0]);
  };
  const double start = energy();
  Energies result;
  while (!simulation.finished() && result.ok) {
    const auto step = simulation.advance();
    result.ok = step.ok;
    result.damped_steps += step.report.damped_steps;
    result.growth = std::max(result.growth, energy() / start);
  }
  return result;
}

TEST(EnergyGuard, StopsASupersonicImpactFromCreatingEnergy) {
  const Energies guarded = simulate(supersonic_impact(0.05));
  EXPECT_TRUE(guarded.ok);
  EXPECT_GT(guarded.damped_steps, 0);
  EXPECT_LT(guarded.growth, 1.06);
  for (const double off : {1e300, std::numeric_limits<double>::infinity()}) {
    const Energies plain = simulate(supersonic_impact(off));
    EXPECT_EQ(plain.damped_steps, 0);
    EXPECT_TRUE(!plain.ok || plain.growth > 1.2) << "this impact does not need the guard: growth " << plain.growth;
  }
}

/// The solve before remeshing keeps energy here where the one after it does not.
TEST(EnergyGuard, HoldsForTheStepAsItEndsAfterRemeshing) {
  const auto impact = [](double limit) {
    auto setup = supersonic_impact(limit);
    setup.initial_velocity = {{1, [](const Vec<2>&, double) { return Vec<2>(0, -8); }}};
    setup.time.dt = 2e-3;
    setup.time.steps = 10;
    setup.remesh.enabled = true;
    setup.remesh.split.acceptance_tolerance = 1e-2;
    setup.remesh.split.min_edge_length = 0.02;
    setup.remesh.collapse.enabled = false;
    return simulate(setup);
  };
  const Energies guarded = impact(0.01);
  EXPECT_TRUE(guarded.ok);
  EXPECT_GT(guarded.damped_steps, 0);
  EXPECT_LT(guarded.growth, 1.01);
  const Energies plain = impact(1e300);
  EXPECT_EQ(plain.damped_steps, 0);
  EXPECT_TRUE(!plain.ok || plain.growth > 1.2) << "this impact does not need the guard: growth " << plain.growth;
}

TEST(EnergyGuard, LeavesAloneWhatKeepsEnergy) {
  auto setup = square_over_line();
  setup.obstacles = {};
  setup.contact = {};
  setup.time.dt = 2e-3;
  setup.time.steps = 200;
  setup.initial_velocity = {{1, [](const Vec<2>& X, double) { return Vec<2>(X[1], X[0] - 0.1); }}};
  const Energies energies = simulate(setup);
  EXPECT_TRUE(energies.ok);
  EXPECT_EQ(energies.damped_steps, 0);
}

struct Drive {
  const char* name;
  std::function<void(Setup<2>&)> start;
};
void PrintTo(const Drive& drive, std::ostream* out) { *out << drive.name; }

class DrivenFromRest : public ::testing::TestWithParam<Drive> {};

/// At rest there is no mechanical energy to begin with.
TEST_P(DrivenFromRest, IsLeftAlone) {
  auto setup = square_over_line();
  GetParam().start(setup);
  const Energies energies = simulate(setup);
  EXPECT_TRUE(energies.ok);
  EXPECT_EQ(energies.damped_steps, 0);
}

void hold(Setup<2>& setup, int side, SpaceTimeFunction<2> displacement) {
  setup.dirichlet.push_back({side, {true, true}, std::move(displacement)});
}

INSTANTIATE_TEST_SUITE_P(
    All, DrivenFromRest,
    ::testing::Values(Drive{"held_vertices",
                            [](Setup<2>& setup) {
                              hold(setup, 4, [](const Vec<2>&, double t) { return Vec<2>(0, 0.4 * t); });
                              hold(setup, 2, [](const Vec<2>&, double) { return Vec<2>(0, 0); });
                            }},
                      Drive{"gravity",
                            [](Setup<2>& setup) {
                              hold(setup, 2, [](const Vec<2>&, double) { return Vec<2>(0, 0); });
                              setup.body_acceleration = [](const Vec<2>&, double) { return Vec<2>(0, -9.81); };
                            }},
                      Drive{"gravity_on_steel",
                            [](Setup<2>& setup) {
                              hold(setup, 2, [](const Vec<2>&, double) { return Vec<2>(0, 0); });
                              setup.materials[1].youngs_modulus = 2e11;
                              setup.body_acceleration = [](const Vec<2>&, double) { return Vec<2>(0, -9.81); };
                            }},
                      Drive{"traction",
                            [](Setup<2>& setup) {
                              hold(setup, 2, [](const Vec<2>&, double) { return Vec<2>(0, 0); });
                              setup.neumann.push_back({4, [](const Vec<2>&, double) { return Vec<2>(300, 500); }});
                            }},
                      Drive{"an_obstacle",
                            [](Setup<2>& setup) {
                              setup.time.dt = 1e-3;  // a step is shorter than the way through the barrier
                              setup.time.steps = 100;
                              setup.obstacles.motion = {0, 0};
                              setup.obstacles.motions = {[](const Vec<2>&, double t) { return Vec<2>(0, 0.3 * t); }};
                            }}),
    [](const auto& info) { return std::string(info.param.name); });

TEST(EnergyGuard, HasNoSayInASolveThatDoesNotConverge) {
  auto setup = supersonic_impact(0.05);
  setup.initial_velocity = {{1, [](const Vec<2>& X, double) { return Vec<2>(0, -2 * X[0]); }}};
  setup.newton.max_iterations = 1;
  setup.newton.step_tolerance = setup.newton.gradient_tolerance = setup.newton.first_gradient_tolerance = 1e-300;
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const auto step = simulation.advance();
  EXPECT_FALSE(step.ok);
  EXPECT_EQ(step.report.damped_steps, 0);
  EXPECT_EQ(step.report.newton_iterations, 1);
}

}  // namespace
}  // namespace itr
