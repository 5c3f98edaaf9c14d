// SPDX-License-Identifier: MIT
// Bodies without inertia that only contact will hold, or nothing will, and held ones that turn far.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <optional>
#include <random>

#include "curved_mesh.hpp"
#include "derivatives.hpp"
#include "energy/least_motion.hpp"
#include "itr/solver.hpp"
#include "random_tets.hpp"
#include "simulation/held_turn.hpp"
#include "simulation/step_problem.hpp"
#include "simulation_scenes.hpp"

namespace itr {
namespace {

constexpr double kGravity = 9.81;

/// A square of 0.2 m and 40 kg, 20 mm above a table, without inertia.
Setup<2> square_above_a_table(double modulus, const std::string& solver = "eigen") {
  Setup<2> setup;
  setup.mesh = make_square(3, 0.2);
  setup.materials[1] = {.youngs_modulus = modulus, .poisson_ratio = 0.3, .density = 1000};
  setup.body_acceleration = [](const Vec<2>&, double) { return Vec<2>(0, -kGravity); };
  setup.obstacles.rest = {{-1, -0.02}, {1, -0.02}};
  setup.obstacles.edges = {{0, 1}};
  setup.obstacles.motion = {kNone, kNone};
  setup.contact = {.enabled = true, .dhat = 1e-4, .convergent = true};
  setup.time = {.quasistatic = true, .dt = 1, .steps = 1};
  setup.linear.solvers = {solver};
  return setup;
}

/// Mean displacement of the mass.
template <int Dim>
Vec<Dim> mean_displacement(const Simulation<Dim>& simulation) {
  const auto& state = simulation.state();
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (CellId c = 0; c < state.mesh.cell_slots(); ++c)
    for (const int v : state.mesh.cell(c))
      sum += state.mesh.volume(c) / (Dim + 1) * (state.history.x[0].template segment<Dim>(Dim * v) - state.mesh.rest(v));
  return sum / state.mesh.total_volume();
}

TEST(LooseBodies, ComeDownStraightWhateverModulusAndSolver) {
  for (const std::string solver : {"eigen:ldlt", "eigen:lu"})
    for (const double modulus : {1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11}) {
      SCOPED_TRACE(solver + " " + std::to_string(modulus));
      linear::Registry registry;
      Simulation<2> simulation(square_above_a_table(modulus, solver), registry);
      const auto result = simulation.advance();
      ASSERT_TRUE(result.ok) << result.reason;
      const Vec<2> moved = mean_displacement(simulation);
      EXPECT_NEAR(moved[0], 0, 1e-6 * 0.2);
      EXPECT_NEAR(moved[1], -0.02, 1e-3 + kGravity * 1000 * 0.04 / modulus);
      EXPECT_LE(result.report.newton_iterations, 60);
    }
}

/// The square and another one, 5 mm above it and 40 mm beside.
Setup<2> stack_above_a_table(double friction) {
  auto setup = square_above_a_table(1e7);
  const Grid grid = make_regular_grid(3, 0.2, [](int i, int j) { return (i + j) % 2; });
  std::vector<Vec<2>> rest = grid.rest;
  std::vector<Mesh<2>::Cell> cells = grid.cells;
  const int count = static_cast<int>(rest.size());
  for (const Vec<2>& X : grid.rest) rest.push_back(X + Vec<2>(0.04, 0.205));
  for (const auto& cell : grid.cells) cells.push_back({cell[0] + count, cell[1] + count, cell[2] + count});
  setup.mesh = Mesh<2>(rest, cells, std::vector<int>(cells.size(), 1));
  setup.contact.friction_coefficient = friction;
  return setup;
}

/// Friction keeps the upper one, although nothing touches anything where the step begins.
TEST(LooseBodies, InAStackAreHeldByTheFrictionOfNewContact) {
  for (const double friction : {0.1, 0.3, 1.0}) {
    linear::Registry registry;
    Simulation<2> simulation(stack_above_a_table(friction), registry);
    const auto result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    const Vec<2> moved = mean_displacement(simulation);
    EXPECT_NEAR(moved[0], 0, 1e-3 * 0.2) << friction;
    EXPECT_NEAR(moved[1], -0.0225, 1e-3) << friction;
  }
}

/// A box on another one with a stiffness 27 times its own, above a table: under a stiff barrier both bounce on the way.
Setup<3> boxes_above_a_table() {
  Setup<3> setup;
  setup.mesh = make_cubes(
      3,
      [](int i, int j, int k) {
        constexpr double kHeights[] = {0, 0.7654, 0.81566, 1.58106};
        return Vec<3>(0.3881 * i, kHeights[j], 0.88624 * k);
      },
      [](int i, int j, int k) { return i < 2 && j != 1 && k == 0 ? 1 + j / 2 : kNone; });
  setup.materials[1] = {.law = MaterialLaw::saint_venant_kirchhoff, .youngs_modulus = 2.173e10, .density = 1000};
  setup.materials[2] = {.law = MaterialLaw::saint_venant_kirchhoff, .youngs_modulus = 8.157e8, .density = 1000};
  setup.body_acceleration = [](const Vec<3>&, double) { return Vec<3>(0, -kGravity, 0); };
  const double height = -0.021;
  setup.obstacles.rest = {{-50, height, -50}, {0, height, 100}, {50, height, -50}};
  setup.obstacles.triangles = {{0, 1, 2}};
  setup.obstacles.edges = {{0, 1}, {1, 2}, {0, 2}};
  setup.obstacles.motion = {kNone, kNone, kNone};
  setup.time.is_static = true;
  setup.contact = {.enabled = true, .dhat = 2.7e-4, .convergent = false};
  setup.contact.friction_coefficient = 0.3;
  return setup;
}

TEST(LooseBodies, InAStackLieFlatWithTheFrictionOfContactThatIsThere) {
  for (const double dhat : {1e-4, 2e-4, 2.7e-4, 5e-4, 1e-3}) {
    SCOPED_TRACE(dhat);
    auto setup = boxes_above_a_table();
    setup.contact.dhat = dhat;
    linear::Registry registry;
    Simulation<3> simulation(setup, registry);
    const auto result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    const auto& state = simulation.state();
    for (VertexId v = 0; v < state.mesh.node_slots(); ++v) {
      const Vec<3> X = state.mesh.rest(v), u = state.history.x[0].segment<3>(3 * v) - X;
      EXPECT_LE(std::hypot(u[0], u[2]), 1e-3) << X.transpose();
      EXPECT_NEAR(u[1], X[1] < 0.8 ? -0.021 : -0.021 - 0.05026, 2 * dhat) << X.transpose();
    }
  }
}

/// Friction in rounds until it fits, as by the defaults of a scene.
void settle_friction(ContactOptions& contact, double& lagging_tolerance) {
  contact.friction_velocity = 0;
  contact.friction_iterations = -1;
  lagging_tolerance = 1e-3;
}

/// Vertices of the lower one are below those of the upper one: tangents of their pairs are tilted, and differ by round.
TEST(LooseBodies, ThatLandOnTheirMirrorImageSettleInFewRounds) {
  for (const double depth : {0.3, 0.88624}) {
    auto setup = boxes_above_a_table();
    setup.mesh = make_cubes(
        3,
        [&](int i, int j, int k) {
          constexpr double kHeights[] = {0, 0.4, 0.42, 0.82};
          return Vec<3>(0.3881 * i, kHeights[j], depth * k);
        },
        [](int i, int j, int k) { return i < 2 && j != 1 && k < 2 ? 1 + j / 2 : kNone; });
    settle_friction(setup.contact, setup.lagging_tolerance);
    linear::Registry registry;
    Simulation<3> simulation(setup, registry);
    const auto result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    EXPECT_EQ(result.report.cut_steps, 0);
    EXPECT_LE(result.report.newton_iterations, 200);
  }
}

/// Three discs of 24 triangles each, the third one on the two others, above a table.
Setup<2> pyramid_above_a_table(const std::string& solver) {
  constexpr int kRim = 24;
  constexpr double kRadius = 0.5;
  std::vector<Vec<2>> rest;
  std::vector<Mesh<2>::Cell> cells;
  for (const Vec<2>& centre : {Vec<2>(-0.501, 0.502), Vec<2>(0.501, 0.502), Vec<2>(0, 1.37)}) {
    const int first = static_cast<int>(rest.size());
    rest.push_back(centre);
    for (int i = 0; i < kRim; ++i) {
      const double angle = 2 * std::numbers::pi * (i + 0.3) / kRim;
      rest.push_back(centre + kRadius * Vec<2>(std::cos(angle), std::sin(angle)));
      cells.push_back({first, first + 1 + i, first + 1 + (i + 1) % kRim});
    }
  }
  auto setup = square_above_a_table(1e6, solver);
  setup.mesh = Mesh<2>(rest, cells, std::vector<int>(cells.size(), 1));
  setup.obstacles.rest = {{-3, 0}, {3, 0}};
  setup.contact.dhat = 5e-4;
  setup.contact.friction_coefficient = 0.5;
  settle_friction(setup.contact, setup.lagging_tolerance);
  return setup;
}

/// To stand needs a coefficient of tan 15 degrees, 0.27, and friction of contacts that are not there where the step begins.
TEST(LooseBodies, InAPyramidStandWhateverTheSolver) {
  std::map<int, VectorX> first;  // by order
  for (const auto& [order, solver] :
       {std::pair{1, "eigen:ldlt"}, {1, "eigen:lu"}, {1, "dense"}, {2, "dense"}, {2, "eigen:lu"}}) {
    linear::Registry registry;
    auto setup = pyramid_above_a_table(solver);
    setup.order[1] = order;
    if (order == 2) setup.contact.friction_coefficient = 0.8;
    Simulation<2> simulation(setup, registry);
    const auto result = simulation.advance();
    ASSERT_TRUE(result.ok) << solver << ": " << result.reason;
    const VectorX& x = simulation.state().history.x[0];
    EXPECT_GT(x[2 * 50 + 1], 1.3) << solver << ": centre of the upper disc";
    EXPECT_LE(result.report.newton_iterations, 400) << solver;
    EXPECT_LE((x - first.try_emplace(order, x).first->second).lpNorm<Eigen::Infinity>(), 1e-6) << solver;
  }
}

TEST(LooseBodies, StayWhereNoForceActs) {
  auto setup = square_above_a_table(1e6);
  setup.body_acceleration = {};
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const auto result = simulation.advance();
  ASSERT_TRUE(result.ok) << result.reason;
  EXPECT_LE(mean_displacement(simulation).norm(), 1e-15);
}

/// Forces in balance leave all rigid motions neutral.
TEST(LooseBodies, InBalanceDoNotDrift) {
  for (const double modulus : {1e4, 1e7, 1e11}) {
    SCOPED_TRACE(modulus);
    auto setup = square_above_a_table(modulus);
    setup.body_acceleration = {};
    setup.contact.enabled = false;
    setup.obstacles = {};
    for (const int side : {1, 3})
      setup.neumann.push_back({side, [=](const Vec<2>&, double) { return Vec<2>((side - 2) * 1e-4 * modulus, 0); }});
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    const auto result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    EXPECT_LE(mean_displacement(simulation).norm(), 1e-9);
    EXPECT_GT(result.report.energy.elastic, 0);
  }
}

/// Positions far from the origin have few digits of the displacements, and later steps nothing to do.
TEST(LooseBodies, InBalanceStayInLaterSteps) {
  auto setup = square_above_a_table(7.6e5, "dense");
  const Mesh<2> square = make_square(3, 0.0025);
  std::vector<Vec<2>> rest;
  std::vector<Mesh<2>::Cell> cells;
  for (VertexId v = 0; v < square.node_slots(); ++v) rest.push_back(square.rest(v) + Vec<2>(0.05, -0.09));
  for (CellId c = 0; c < square.cell_slots(); ++c) cells.push_back(square.cell(c));
  setup.mesh = Mesh<2>(rest, cells, std::vector<int>(cells.size(), 1));
  for (const FacetId f : square.live_facets()) setup.mesh.set_facet_tag(f, square.facet_tag(f));
  setup.order[1] = 2;
  setup.materials[1].law = MaterialLaw::linear;
  setup.body_acceleration = {};
  setup.contact.enabled = false;
  setup.obstacles = {};
  setup.time.steps = 4;
  for (const int side : {1, 3})
    setup.neumann.push_back({side, [=](const Vec<2>&, double) { return Vec<2>((side - 2) * 1.9e-5, 0); }});
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  ASSERT_TRUE(simulation.advance().ok);
  const VectorX first = simulation.state().history.x[0];
  const auto& mesh = simulation.state().mesh;
  double largest = 0;
  for (VertexId v = 0; v < mesh.node_slots(); ++v)
    largest = std::max(largest, (first.segment<2>(2 * v) - mesh.rest(v)).lpNorm<Eigen::Infinity>());
  for (int step = 1; step < 4; ++step) {
    ASSERT_TRUE(simulation.advance().ok);
    EXPECT_LE((simulation.state().history.x[0] - first).lpNorm<Eigen::Infinity>(), 1e-2 * largest) << step;
  }
}

/// A pressure all around resists turns of a linear elastic body, by far less than the body resists strains.
TEST(LooseBodies, UnderPressureDoNotTurn) {
  for (const std::string solver : {"eigen:ldlt", "eigen:lu"}) {
    SCOPED_TRACE(solver);
    auto setup = square_above_a_table(8.7e10, solver);
    setup.materials[1].law = MaterialLaw::linear;
    setup.body_acceleration = {};
    setup.contact.enabled = false;
    setup.obstacles = {};
    for (const int side : {1, 2, 3, 4}) setup.pressure.push_back({side, [](const Vec<2>&, double t) { return 5 * t; }});
    setup.time.steps = 4;
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    while (simulation.state().step < setup.time.steps) ASSERT_TRUE(simulation.advance().ok);
    const auto& state = simulation.state();
    double turn = 0, inwards = 0;
    for (VertexId v = 0; v < state.mesh.node_slots(); ++v) {
      const Vec<2> arm = state.mesh.rest(v) - Vec<2>(0.1, 0.1),
                   u = state.history.x[0].segment<2>(2 * v) - state.mesh.rest(v);
      turn += arm[0] * u[1] - arm[1] * u[0];
      inwards -= arm.dot(u);
    }
    EXPECT_GT(inwards, 0);
    EXPECT_LE(std::abs(turn), 1e-4 * inwards);
  }
}

TEST(LooseBodies, ThatNothingWillHoldStopTheRunSoon) {
  auto setup = square_above_a_table(1e6);
  setup.contact.enabled = false;
  setup.obstacles = {};
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const auto result = simulation.advance();
  EXPECT_FALSE(result.ok);
  EXPECT_LE(result.report.newton_iterations, 50);
  EXPECT_NE(result.reason.find("no equilibrium"), std::string::npos) << result.reason;
}

TEST(LooseBodies, AreFoundByTheRankOfTheirConditions) {
  const Mesh<2> mesh = make_square(2, 0.2);
  const CellSet<2> cells = whole_mesh(mesh, {});
  VectorX x(2 * cells.num_vertices);
  for (int v = 0; v < cells.num_vertices; ++v) x.segment<2>(2 * v) = cells.rest[v];
  const std::map<int, Material> materials = {{1, {}}};
  const auto is_loose = [&](std::initializer_list<int> dofs) {
    std::vector<char> held(x.size(), 0);
    for (const int dof : dofs) held[dof] = 1;
    return !find_loose_parts<2>(cells, x, held, materials).empty();
  };
  EXPECT_TRUE(is_loose({}));
  EXPECT_TRUE(is_loose({0, 1})) << "one point: it turns";
  EXPECT_TRUE(is_loose({1, 3, 5})) << "rollers along one side";
  EXPECT_FALSE(is_loose({1, 3, 0})) << "rollers and a point";
  EXPECT_TRUE(is_loose({0, 2, 4})) << "all of one component on a line along it";
  EXPECT_FALSE(is_loose({0, 1, 2, 3}));
}

/// Holds them where they are, as the force that acts on them would carry them by a fiftieth of their size.
template <int Dim>
void expect_hold_derivatives(const Mesh<Dim>& mesh) {
  const CellSet<Dim> cells = whole_mesh(mesh, {});
  VectorX rest(Dim * mesh.node_slots());
  for (VertexId v = 0; v < mesh.node_slots(); ++v) rest.template segment<Dim>(Dim * v) = mesh.rest(v);
  const DofMap dofs = all_free(rest.size());
  LeastMotion<Dim> term(cells, find_loose_parts<Dim>(cells, rest, std::vector<char>(rest.size(), 0), {{1, {}}}), 0.5);
  const VectorX force = VectorX::Constant(rest.size(), 3);
  term.follow(force, force, dofs);
  EXPECT_FALSE(term.is_holding());
  EXPECT_EQ(gradient_of(term, rest).norm(), 0);
  term.hold(rest, 0.02);
  EXPECT_TRUE(term.is_holding());
  std::mt19937 random(2);
  std::normal_distribution<double> noise(0, 0.1);
  const VectorX x = rest + VectorX::NullaryExpr(rest.size(), [&] { return noise(random); });
  const VectorX gradient = gradient_of(term, x);
  VectorX plus, minus, difference(x.size());
  Workspace workspace;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    plus = minus = x;
    plus[i] += 1e-4;
    minus[i] -= 1e-4;
    difference[i] = (term.value(plus, workspace) - term.value(minus, workspace)) / 2e-4;
  }
  EXPECT_LE((difference - gradient).norm(), 1e-7 * gradient.norm());
  // The Hessian has the stiffness of steps of least motion, too.
  const LoosePart<Dim>& part = term.parts()[0];
  const VectorX curved = hessian_of(term, x, PsdProjection::none) * (x - rest);
  EXPECT_LE((curved - part.curvature() / part.hold * gradient).norm(), 1e-12 * curved.norm());
  EXPECT_GT(part.curvature(), part.hold);
  term.hold(rest, std::numeric_limits<double>::infinity());
  EXPECT_FALSE(term.is_holding());
}

TEST(LooseBodies, AreHeldByTheDerivativesOfAnEnergy) {
  expect_hold_derivatives<2>(make_square(2, 0.2));
  expect_hold_derivatives<2>(of_orders(make_square(2, 0.2), {{1, 2}}));
  expect_hold_derivatives<3>(make_cubes(
      2, [](int i, int j, int k) { return Vec<3>(i, 2 * j, k + 0.3 * i); }, [](int, int, int) { return 1; }));
}

TEST(LooseBodies, AreConnectedPartsIn3D) {
  const Mesh<3> mesh = make_cubes(
      3, [](int i, int j, int k) { return Vec<3>(i, j, k); }, [](int i, int, int) { return i == 1 ? kNone : 1; });
  const CellSet<3> cells = whole_mesh(mesh, {});
  VectorX x(3 * cells.num_vertices);
  std::vector<char> held(x.size(), 0);
  for (int v = 0; v < cells.num_vertices; ++v) {
    x.segment<3>(3 * v) = cells.rest[v];
    if (cells.rest[v][0] == 0) held[3 * v] = held[3 * v + 1] = held[3 * v + 2] = 1;
  }
  const auto loose = find_loose_parts<3>(cells, x, held, {{1, {}}});
  ASSERT_EQ(loose.parts.size(), 1u);
  for (const int node : loose.parts[0].nodes) EXPECT_GE(cells.rest[node][0], 2);
  double mass = 0;
  for (std::size_t e = 0; e < loose.mass.size(); ++e)
    if (loose.of_element[e] != kNone) mass += loose.mass[e];
  EXPECT_NEAR(mass, 1, 1e-14);
}

TEST(HeldBodies, ThatLoadsCarryAwayStopTheRunSoon) {
  auto setup = square_above_a_table(1e6);
  setup.contact.enabled = false;
  setup.obstacles = {};
  setup.dirichlet.push_back({1, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }});
  setup.neumann.push_back({3, [](const Vec<2>&, double) { return Vec<2>(1e10, 0); }});
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const auto result = simulation.advance();
  EXPECT_FALSE(result.ok);
  EXPECT_LE(result.report.newton_iterations, 100);
  EXPECT_NE(result.reason.find("no equilibrium"), std::string::npos) << result.reason;
}

/// A square whose side turns by so many degrees in a step, without inertia.
itr::Setup<2> turned_square(double degrees) {
  itr::Setup<2> setup;
  setup.mesh = make_square(2, 0.2);
  setup.materials[1] = {.youngs_modulus = 1e6, .poisson_ratio = 0.3, .density = 1000};
  const auto turn = [degrees](const Vec<2>& X, double t) {
    return Vec<2>(Eigen::Rotation2Dd(t * degrees * M_PI / 180) * X - X);
  };
  setup.dirichlet.push_back({1, {true, true}, turn});
  setup.time = {.quasistatic = true, .dt = 1, .steps = 1};
  return setup;
}

TEST(HeldBodies, TurnByNinetyDegreesInAStep) {
  linear::Registry registry;
  Simulation<2> simulation(turned_square(90), registry);
  const auto result = simulation.advance();
  ASSERT_TRUE(result.ok) << result.reason;
  EXPECT_LE(result.report.energy.elastic, 1e-12 * 1e6 * 0.04);
}

/// Vertices on a line do not tell a turn about it: none is made up from round-off.
TEST(HeldBodies, OnAHingeAreNotSaidToTurn) {
  const Mesh<3> mesh = make_cubes(3, unit_grid(3), [](int, int, int) { return 1; });
  const CellSet<3> cells = whole_mesh(mesh, {});
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> draw;
    const Mat<3> turn = Eigen::Quaterniond(draw(random), draw(random), draw(random), draw(random)).normalized().matrix();
    VectorX x(3 * cells.num_vertices);
    std::vector<char> held(x.size(), 0);
    for (int v = 0; v < cells.num_vertices; ++v) {
      x.segment<3>(3 * v) = turn * cells.rest[v];
      if (cells.rest[v][0] == 0 && cells.rest[v][1] == 0) held[3 * v] = held[3 * v + 1] = held[3 * v + 2] = 1;
    }
    EXPECT_EQ(describe_large_turn<3>(cells, DofMap::from_held(held), x, x), "") << seed;
  }
}

TEST(HeldBodies, TurnByHalfATurnNotInOneStepAndSayWhy) {
  auto setup = turned_square(180);
  linear::Registry registry;
  const auto result = Simulation<2>(setup, registry).advance();
  ASSERT_FALSE(result.ok);
  EXPECT_NE(result.reason.find("by 180 degrees"), std::string::npos) << result.reason;
  setup.time.step_cuts = 4;
  Simulation<2> cut(setup, registry);
  const auto in_parts = cut.advance();
  ASSERT_TRUE(in_parts.ok) << in_parts.reason;
  EXPECT_LE(in_parts.report.energy.elastic, 1e-12 * 1e6 * 0.04);
}

}  // namespace
}  // namespace itr
