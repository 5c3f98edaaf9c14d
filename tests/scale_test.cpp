// SPDX-License-Identifier: MIT
// No length, count or force is taken for granted: results do not depend on the unit of length, and starts are balanced.
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <memory>
#include <span>
#include <string>

#include "core/count.hpp"
#include "itr/core.hpp"
#include "itr/solver.hpp"
#include "simulation/state.hpp"
#include "square_mesh.hpp"

namespace itr {
namespace {

constexpr double kSide = 2e-3;  // of a body of 2 mm, in metres

Mesh<2> make_body(double unit, Mesh<2>*) {
  const Grid grid = make_regular_grid(4, kSide * unit, [](int i, int j) { return (i + j) % 2; });
  return Mesh<2>(grid.rest, grid.cells, std::vector<int>(grid.cells.size(), 1));
}

/// A cube of six tetrahedra around its diagonal.
Mesh<3> make_body(double unit, Mesh<3>*) {
  std::vector<Vec<3>> rest;
  for (int i = 0; i < 8; ++i) rest.emplace_back(kSide * unit * Vec<3>(i & 1, i >> 1 & 1, i >> 2 & 1));
  const std::vector<std::array<int, 4>> cells = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7},
                                                 {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
  return Mesh<3>(rest, cells, std::vector<int>(6, 1));
}

/// A soft body slides over a floor; `unit` units of length make a metre.
template <int Dim>
Setup<Dim> sliding_body(double unit) {
  Setup<Dim> setup;
  setup.mesh = make_body(unit, static_cast<Mesh<Dim>*>(nullptr));
  // Units of stress, density and energy in kg, s and the unit of length; in 2D by thickness in it too, which drops out.
  const double stress = Dim == 3 ? 1 / unit : 1, density = stress / (unit * unit), energy = unit * unit;
  setup.materials[1] = {.youngs_modulus = 1e4 * stress, .poisson_ratio = 0.4, .density = 1000 * density};
  setup.time = {.dt = 1e-4, .steps = 12};
  setup.newton.step_tolerance = 1e-12 * unit;
  setup.newton.gradient_tolerance = setup.newton.first_gradient_tolerance = 0;
  const double floor = -1e-5 * unit, width = 0.1 * unit;
  if constexpr (Dim == 2) {
    setup.obstacles.rest = {{-width, floor}, {width, floor}};
    setup.obstacles.edges = {{0, 1}};
  } else {
    setup.obstacles.rest = {{-width, floor, -width}, {width, floor, -width}, {0, floor, width}};
    setup.obstacles.edges = {{0, 1}, {1, 2}, {0, 2}};
    setup.obstacles.triangles = {{0, 1, 2}};
  }
  setup.obstacles.motion.assign(setup.obstacles.rest.size(), kNone);
  setup.contact = {.enabled = true,
                   .dhat = 2e-5 * unit,
                   .convergent = true,
                   .barrier_stiffness = 1e4 * stress,
                   .friction_coefficient = 0.3,
                   .friction_velocity = 1e-3 * unit,
                   .friction_iterations = -1,
                   .friction_tolerance = 0};
  Vec<Dim> start = Vec<Dim>::Zero();
  start[0] = 0.1 * unit;
  start[1] = -0.5 * unit;
  setup.initial_velocity.push_back({1, [start](const Vec<Dim>&, double) { return start; }});
  setup.remesh.split.acceptance_tolerance = 1e-8 * energy;
  setup.remesh.collapse.acceptance_tolerance = -1e-10 * energy;
  setup.remesh.collapse.rel_max_edge_length = 2;
  return setup;
}

struct Ending {
  VectorX x;  ///< of the bodies, in metres
  int splits = 0;
};

template <int Dim>
Ending simulate(const Setup<Dim>& setup, double unit) {
  linear::Registry registry;
  Simulation<Dim> simulation(setup, registry);
  Ending ending;
  while (!simulation.finished()) {
    const auto step = simulation.advance();
    if (!step.ok) {
      ADD_FAILURE() << "unit " << unit << ", step " << simulation.state().step << ": " << step.reason;
      break;
    }
    ending.splits += step.report.splits.accepted;
  }
  const auto& state = simulation.state();
  ending.x = state.history.x[0].head(Dim * state.mesh.num_vertices()) / unit;
  return ending;
}

constexpr double kUnits[] = {1048576, 1024,
                             1.0 / 1024};  // nearly um, mm, km; of two, so that all is scaled without round-off

template <int Dim>
void expect_same_in_all_units(std::span<const double> units, const std::function<Setup<Dim>(double)>& setup_in,
                              double tolerance) {
  const Ending metres = simulate(setup_in(1), 1);
  EXPECT_EQ(metres.splits > 0, setup_in(1).remesh.enabled);
  for (const double unit : units) {
    const Ending other = simulate(setup_in(unit), unit);
    ASSERT_EQ(other.x.size(), metres.x.size()) << unit;
    EXPECT_EQ(other.splits, metres.splits) << unit;
    EXPECT_LE((other.x - metres.x).template lpNorm<Eigen::Infinity>(), tolerance) << unit;
  }
}

template <int Dim>
void expect_same_in_all_units(bool remeshed) {
  const auto in_unit = [&](double unit) {
    auto setup = sliding_body<Dim>(unit);
    setup.remesh.enabled = remeshed;
    return setup;
  };
  expect_same_in_all_units<Dim>(kUnits, in_unit, 1e-9 * kSide);
}

TEST(Scales, FixedMeshIn2dDoesNotSeeTheUnitOfLength) { expect_same_in_all_units<2>(false); }
TEST(Scales, RemeshedBodyDoesNotSeeTheUnitOfLength) { expect_same_in_all_units<2>(true); }
// Symmetric scenes have many edges of one gain, to round-off.
TEST(Scales, RoundOffDoesNotChooseBetweenMirrorImages) {
  const auto in_unit = [](double unit) {
    auto setup = sliding_body<2>(unit);
    setup.remesh.enabled = true;
    setup.contact.friction_coefficient = 0;
    setup.initial_velocity.clear();
    setup.initial_velocity.push_back({1, [unit](const Vec<2>&, double) { return Vec<2>(0, -0.5 * unit); }});
    return setup;
  };
  const double units[] = {1e6, 1e3, 1e-3};
  expect_same_in_all_units<2>(units, in_unit, 1e-6 * kSide);
}
TEST(Scales, FixedMeshIn3dDoesNotSeeTheUnitOfLength) { expect_same_in_all_units<3>(false); }

TEST(Counts, BeyondTheReachOfIndicesAreRefused) {
  constexpr std::size_t kMost = std::numeric_limits<int>::max();
  EXPECT_EQ(as_index(kMost, "nonzeros"), std::numeric_limits<int>::max());
  try {
    as_index(kMost + 1, "nonzeros");
    FAIL() << "was cast";
  } catch (const InputError& error) {
    EXPECT_EQ(error.parts().place, "nonzeros");
    EXPECT_EQ(error.parts().found, "2147483648");
  }
}

/// A body in contact that slides and is sheared: all forces act.
Setup<2> loaded_at_start() {
  auto setup = sliding_body<2>(1);
  setup.body_acceleration = [](const Vec<2>&, double) { return Vec<2>(0, -9.81); };
  setup.initial_velocity = {{1, [](const Vec<2>& X, double) { return Vec<2>(0.1 + 20 * X[1], 0); }}};
  setup.damping.push_back({DampingOptions::Term::elastic, 1e-4, 1});
  setup.contact.friction_iterations = 1;
  setup.consistent_initial_acceleration = true;
  return setup;
}

TEST(ConsistentAcceleration, IsWhatTheFirstShortStepFinds) {
  auto setup = loaded_at_start();
  setup.time.integrator = Integrator::newmark;
  linear::Registry registry;
  const VectorX a = Simulation<2>(setup, registry).state().history.a[0];
  setup.time.integrator = Integrator::implicit_euler;
  setup.time.dt = 1e-9;
  setup.newton.step_tolerance = 1e-22;
  Simulation<2> simulation(setup, registry);
  const VectorX v = simulation.state().history.v[0];
  ASSERT_TRUE(simulation.advance().ok);
  const VectorX found = (simulation.state().history.v[0] - v) / setup.time.dt;
  ASSERT_GT(a.norm(), 100);
  EXPECT_LE((a - found).norm(), 1e-3 * a.norm());
}

class Failing final : public linear::Engine {
 public:
  bool set_option(const std::string&, const std::string&) override { return false; }
  linear::Outcome analyze(const linear::SparsityPattern&, const linear::AnalyzeHints&) override {
    return linear::Outcome::ok;
  }
  linear::Outcome factorize(std::span<const double>) override { return linear::Outcome::singular; }
  linear::Outcome solve(std::span<const double>, std::span<double>, int) override { return linear::Outcome::failed; }
  linear::Statistics statistics() const override { return {}; }
  std::string message() const override { return "it always fails"; }
};

TEST(ConsistentAcceleration, SaysWhyItCouldNotBeFound) {
  linear::Registry registry;
  linear::BackendInfo info;
  info.name = "failing";
  registry.add(info, [](const linear::SolverOptions&) {
    return linear::make_checked_solver("failing", {}, std::make_unique<Failing>());
  });
  auto setup = loaded_at_start();
  setup.time.integrator = Integrator::newmark;
  setup.linear.solvers = {"failing"};
  try {
    const Simulation<2> simulation(setup, registry);
    FAIL() << "started with whatever acceleration";
  } catch (const InputError& error) {
    EXPECT_EQ(error.parts().place, "/initial_conditions/acceleration");
    EXPECT_NE(error.parts().found.find("it always fails"), std::string::npos) << error.parts().found;
  }
}

}  // namespace
}  // namespace itr
