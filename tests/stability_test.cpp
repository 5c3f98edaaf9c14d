// SPDX-License-Identifier: MIT
// Remeshing where nothing is to be gained: it leaves homogeneous states alone, unless they are stable only because
// elements are too stiff.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <string>

#include "advance.hpp"
#include "curved_run.hpp"
#include "random_tets.hpp"
#include "simulation_scenes.hpp"

namespace itr {

namespace {

constexpr double kLength = 10, kThickness = 0.5, kModulus = 1e6;

/// A clamped column whose right end is pushed until straight it would carry 1.6 times Euler's load.
Setup<2> column() {
  Setup<2> setup;
  const Grid grid = make_grid(
      8, [](int i, int j) { return Vec<2>(kLength * i / 8, kThickness * j / 8); }, [](int i, int j) { return (i + j) % 2; });
  setup.mesh = Mesh<2>(grid.rest, grid.cells, std::vector<int>(grid.cells.size(), 1));
  for (FacetId f = 0; f < setup.mesh.facet_slots(); ++f) {
    const double x = (setup.mesh.rest(setup.mesh.facet(f)[0]) + setup.mesh.rest(setup.mesh.facet(f)[1]))[0] / 2;
    setup.mesh.set_facet_tag(f, x == 0 ? 1 : x == kLength ? 2 : 3);
  }
  setup.materials[1] = {.youngs_modulus = kModulus, .poisson_ratio = 0.3, .density = 1000};
  const double direction = 1.6 * std::pow(std::numbers::pi * kThickness / kLength, 2) / 3 * kLength;
  setup.dirichlet = {{1, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }},
                     {2, {true, true}, [direction](const Vec<2>&, double t) { return Vec<2>(-direction * t, 0); }}};
  setup.time = {.dt = 0.25, .steps = 4};
  setup.time.quasistatic = true;
  setup.newton.step_tolerance = 1e-9;
  setup.fields.reaction_forces = true;
  return setup;
}

/// Force at the end of the push, in Euler's loads 4 pi^2 E I / L^2.
double end_load(Setup<2> setup) {
  setup.choose_defaults();
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  double load = 0;
  while (!simulation.finished()) {
    const StepResult step = advance(simulation);
    load = 0;
    for (VertexId v = 0; v < simulation.state().mesh.num_vertices(); ++v)
      if (simulation.state().mesh.rest(v)[0] == 0) load += step.forces.reaction[2 * v];
    for (const auto& [a, b] : simulation.state().mesh.curved_edges())
      if (simulation.state().mesh.rest(a)[0] + simulation.state().mesh.rest(b)[0] == 0)
        load += step.forces.reaction[2 * simulation.state().mesh.node_of(a, b)];
  }
  const double inertia = std::pow(kThickness, 3) / 12;
  return load / (4 * std::pow(std::numbers::pi / kLength, 2) * kModulus * inertia);
}

TEST(Stability, ARemeshedColumnBucklesAtEulersLoad) {
  auto setup = column();
  EXPECT_NEAR(end_load(setup), 1.6, 0.05) << "linear elements of a fixed mesh are expected to lock";
  setup.remesh.enabled = true;
  for (const char* solver : {"eigen:ldlt", "eigen:cg"}) {
    setup.linear.solvers = {solver};
    EXPECT_NEAR(end_load(setup), 1, 0.15) << solver;
  }
}

TEST(Stability, NoEdgeBecomesCurvedWhereThatIsNotAllowed) {
  auto setup = column();
  setup.remesh.enabled = true;
  setup.remesh.curve.for_stability = false;
  EXPECT_FALSE(run(setup).state.mesh.has_nodes());
}

TEST(Stability, APulledStripStaysLinear) {
  auto setup = column();
  setup.remesh.enabled = true;
  setup.dirichlet[1].displacement = [](const Vec<2>&, double t) { return Vec<2>(0.2 * t, 0); };
  EXPECT_FALSE(run(setup).state.mesh.has_nodes());
}

/// Between rough plates a column stands as if it were clamped, up to four times the load that it bears between smooth ones.
TEST(Stability, AColumnThatFrictionHoldsStaysLinearBelowItsLoad) {
  auto setup = column();
  setup.dirichlet.clear();
  for (const double x : {-1e-3, kLength + 1e-3}) {
    const int first = static_cast<int>(setup.obstacles.rest.size());
    setup.obstacles.rest.insert(setup.obstacles.rest.end(), {{x, -kLength}, {x, kLength}});
    setup.obstacles.edges.push_back({first, first + 1});
    setup.obstacles.motion.insert(setup.obstacles.motion.end(), 2, x < 0 ? kNone : 0);
  }
  const double of_euler = 0.5 * std::pow(std::numbers::pi * kThickness / kLength, 2) / 3 * kLength;
  setup.obstacles.motions = {[of_euler](const Vec<2>&, double t) { return Vec<2>(-(2e-3 + of_euler) * t, 0); }};
  setup.contact = {.enabled = true,
                   .dhat = 1e-3,
                   .convergent = true,
                   .barrier_stiffness = 0,
                   .friction_coefficient = 0.5,
                   .friction_velocity = 0,
                   .friction_iterations = -1};
  setup.lagging_tolerance = 1e-3;
  setup.remesh.enabled = true;
  const itr::Run<2> result = run(setup);
  EXPECT_LT(result.nearest, 1e-3) << "it is expected to touch";
  EXPECT_FALSE(result.state.mesh.has_nodes());
}

/// A clamped column of square section, pushed beyond its buckling load in one static solve: two ways to bend whose
/// eigenvalues nearly agree.
TEST(Stability, NoSolverLeavesASquareColumnStraight) {
  constexpr int kAlong = 20;
  constexpr double kSide = 0.08;
  itr::Setup<3> setup;
  const auto at = [](int i, int j, int k) { return Vec<3>(static_cast<double>(i) / kAlong, kSide * j / 2, kSide * k / 2); };
  setup.mesh = make_cubes(kAlong, at, [](int, int j, int k) { return j < 2 && k < 2 ? 1 : kNone; });
  setup.materials[1] = {.youngs_modulus = 1e6, .poisson_ratio = 0.3, .density = 1000};
  setup.dirichlet = {{0, {true, true, true}, [](const Vec<3>&, double) { return Vec<3>(0, 0, 0); }},
                     {1, {true, true, true}, [](const Vec<3>&, double) { return Vec<3>(-0.06, 0, 0); }}};
  setup.time = {.dt = 1, .steps = 1};
  setup.time.quasistatic = true;
  setup.choose_defaults();
  linear::Registry registry;
  registry.allow_mpi_start();
  for (const double nu : {0.3, 0.0})  // without Poisson's effect the first iteration ends at the straight column
    for (const double push : {0.045, 0.055, 0.1}) {
      setup.materials[1].poisson_ratio = nu;
      setup.dirichlet[1].displacement = [push](const Vec<3>&, double) { return Vec<3>(-push, 0, 0); };
      std::map<std::string, double> energy;
      for (const char* solver : {"eigen:ldlt", "eigen:cg", "belos:muelu"}) {
        if (!registry.find(solver).available) continue;
        setup.linear.solvers = {solver};
        Simulation<3> simulation(setup, registry);
        const StepResult step = simulation.advance();
        EXPECT_TRUE(step.ok) << solver << ": " << step.reason;
        energy[solver] = step.report.energy.elastic;
        double bent = 0;
        for (VertexId v = 0; v < simulation.state().mesh.num_vertices(); ++v)
          bent = std::max(
              bent, (simulation.state().history.x[0].segment<3>(3 * v) - simulation.state().mesh.rest(v)).tail<2>().norm());
        EXPECT_GT(bent, 0.5 * kSide) << solver << ", pushed by " << push << ", nu " << nu;
      }
      for (const auto& [solver, joules] : energy)
        EXPECT_NEAR(joules, energy["eigen:ldlt"], 1e-6 * joules) << solver << ", pushed by " << push << ", nu " << nu;
    }
}

/// All sides of a regular mesh's squares are its shortest edges: whether one is longer is round-off.
TEST(Stability, ARegularMeshIsNotCoarsened) {
  itr::Setup<2> setup;
  setup.mesh = make_square(6, 0.2);
  setup.materials[1] = {.youngs_modulus = 1e6, .poisson_ratio = 0.3, .density = 1000};
  const auto nowhere = [](const Vec<2>&, double) { return Vec<2>(0, 0); };
  setup.dirichlet = {{1, {true, false}, nowhere},
                     {2, {false, true}, nowhere},
                     {4, {false, true}, [](const Vec<2>&, double t) { return Vec<2>(0, -0.04 * t); }}};
  setup.time = {.dt = 0.25, .steps = 4};
  setup.time.quasistatic = true;
  setup.newton.step_tolerance = 1e-9;
  setup.remesh.enabled = true;
  const itr::Run<2> result = run(setup);
  EXPECT_EQ(result.splits + result.collapses + result.curves, 0);
}

/// The weights of contact change with the mesh, and so does the barrier's energy: that is nothing gained.
TEST(Stability, ACubePressedBetweenPlatesIsLeftAlone) {
  itr::Setup<3> setup;
  setup.mesh = make_cubes(2, unit_grid(2), [](int, int, int) { return 1; });
  setup.materials[1] = {.youngs_modulus = 1e6, .poisson_ratio = 0.45, .density = 1000};
  const auto nowhere = [](const Vec<3>&, double) { return Vec<3>(Vec<3>::Zero()); };
  setup.dirichlet = {{0, {true, false, false}, nowhere}, {2, {false, true, false}, nowhere}};
  for (const double z : {-2e-4, 1 + 2e-4}) {
    const int first = static_cast<int>(setup.obstacles.rest.size());
    for (const Vec<2>& p : {Vec<2>(-9, -9), Vec<2>(9, -9), Vec<2>(9, 9), Vec<2>(-9, 9)})
      setup.obstacles.rest.emplace_back(p[0], p[1], z);
    setup.obstacles.triangles.push_back({first, first + 1, first + 2});
    setup.obstacles.triangles.push_back({first, first + 2, first + 3});
    setup.obstacles.motion.insert(setup.obstacles.motion.end(), 4, z < 0 ? kNone : 0);
  }
  setup.obstacles.motions = {[](const Vec<3>&, double t) { return Vec<3>(0, 0, -0.5 * t); }};
  setup.contact = {.enabled = true, .dhat = 1.8e-4, .convergent = true, .barrier_stiffness = 0};
  setup.time = {.dt = 0.1, .steps = 10};
  setup.time.quasistatic = true;
  setup.newton.step_tolerance = 1e-9;
  setup.remesh.enabled = true;
  const itr::Run<3> result = run(setup);
  EXPECT_LE(result.splits + result.collapses + result.curves, 20);
  EXPECT_LT(result.nearest, 1.8e-4) << "it is expected to touch";
}

}  // namespace

}  // namespace itr
