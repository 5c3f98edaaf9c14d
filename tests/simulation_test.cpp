// SPDX-License-Identifier: MIT
// Whole steps, with and without remeshing: what must hold whatever the scene.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "itr/core/error.hpp"
#include "itr/core/parallel.hpp"
#include "itr/linear/registry.hpp"
#include "itr/mesh/validate.hpp"
#include "itr/simulation/invariants.hpp"
#include "itr/simulation/simulation.hpp"
#include "itr/simulation/step_problem.hpp"
#include "square_mesh.hpp"

namespace itr {

inline void PrintTo(const TimeOptions& time, std::ostream* out) {
  constexpr const char* kNames[] = {"ImplicitEuler", "ImplicitNewmark", "BDF"};
  *out << kNames[static_cast<int>(time.integrator)];
  if (time.integrator == Integrator::bdf) *out << time.bdf_order;
}
inline void PrintTo(MaterialLaw law, std::ostream* out) {
  constexpr const char* kNames[] = {"NeoHookean", "LinearElasticity", "SaintVenant", "FixedCorotational", "MooneyRivlin"};
  *out << kNames[static_cast<int>(law)];
}

namespace {

/// Diagonals alternate.
Mesh<2> make_square(int n, double size) {
  const Grid grid = make_regular_grid(n, size, [](int i, int j) { return (i + j) % 2; });
  Mesh<2> mesh(grid.rest, grid.cells, std::vector<int>(grid.cells.size(), 1));
  tag_sides(mesh, size);
  return mesh;
}

Setup<2> free_square(int n) {
  Setup<2> setup;
  setup.mesh = make_square(n, 0.2);
  setup.materials[1] = {.youngs_modulus = 1e4, .poisson_ratio = 0.4, .density = 1000};
  setup.time = {.dt = 0.01, .steps = 10};
  setup.newton.step_tolerance = 1e-10;
  setup.newton.gradient_tolerance = setup.newton.first_gradient_tolerance = 1e-14;
  return setup;
}

/// A soft square thrown onto a line.
Setup<2> impact() {
  auto setup = free_square(4);
  setup.obstacles.rest = {{-1, -0.01}, {1, -0.011}};
  setup.obstacles.edges = {{0, 1}};
  setup.obstacles.motion = {kNone, kNone};
  setup.contact = {.enabled = true,
                   .activation_distance = 2e-3,
                   .convergent = true,
                   .barrier_stiffness = 1e4,
                   .friction_coefficient = 0.2};
  setup.initial_velocity.push_back({1, [](const Vec<2>&, double) { return Vec<2>(0.3, -2); }});
  setup.newton.step_tolerance = 1e-7;
  setup.newton.gradient_tolerance = 1e-10;
  return setup;
}

void enable_remeshing(Setup<2>& setup) {
  setup.remesh.enabled = true;
  setup.remesh.split.acceptance_tolerance = 1e-4;
  setup.remesh.split.culling_threshold = 0.8;
  setup.remesh.collapse.acceptance_tolerance = -1e-4;
  setup.remesh.collapse.culling_threshold = 0.1;
  setup.remesh.collapse.rel_max_edge_length = 3;
  setup.remesh.swap.enabled = setup.remesh.smooth.enabled = true;
  setup.remesh.swap.acceptance_tolerance = setup.remesh.smooth.acceptance_tolerance = -1e-5;
}

Vec<2> momentum(const Simulation<2>& simulation) {
  const auto& state = simulation.state();
  const CellSet<2> cells = whole_mesh(state.mesh, simulation.setup().obstacles.rest);
  const VectorX& v = state.history.v[0];
  VectorX product = VectorX::Zero(v.size());
  InertiaEnergy<2>(cells, simulation.setup().materials, MassKind::consistent, VectorX::Zero(v.size()))
      .add_mass_product(v, product);
  Vec<2> sum = Vec<2>::Zero();
  for (int i = 0; i < state.mesh.vertex_slots(); ++i) sum += product.segment<2>(2 * i);
  return sum;
}

void expect_valid(const Simulation<2>& simulation) {
  const auto& state = simulation.state();
  EXPECT_EQ(state.mesh.find_defect(), "");
  EXPECT_NEAR(state.mesh.total_volume(), 0.04, 1e-15);
  for (const VectorX& x : state.history.x) {
    EXPECT_EQ(find_inverted<2>(state.mesh, x), kNone);
    const CollisionSurface surface = collision_surface(state.mesh, simulation.setup().obstacles);
    EXPECT_FALSE(has_intersection<2>(surface, x)) << "step " << state.step;
  }
}

struct Operations {
  int splits = 0, coarsenings = 0;
};

/// Throws the body, which spins and vibrates, with remeshing: its momentum must stay what it was. What was accepted.
Operations fly_with_remeshing(Setup<2> setup) {
  setup.initial_velocity.push_back(
      {1, [](const Vec<2>& X, double) { return Vec<2>(1 + 8 * X[1] * X[1], 40 * X[0] * X[1] - 0.5); }});
  enable_remeshing(setup);
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const Vec<2> start = momentum(simulation);
  Operations done;
  while (!simulation.finished()) {
    const auto result = simulation.advance();
    if (!result.ok) {
      ADD_FAILURE() << result.reason;
      break;
    }
    const StepReport& r = result.report;
    done.splits += r.splits.accepted;
    done.coarsenings += r.collapses.accepted + r.swaps.accepted + r.smooths.accepted;
    EXPECT_LE((momentum(simulation) - start).norm(), 1e-10 * start.norm()) << "step " << simulation.state().step;
    expect_valid(simulation);
  }
  return done;
}

TEST(Simulation, FreeFallIsExact) {
  auto setup = free_square(2);
  setup.body_acceleration = [](const Vec<2>&, double) { return Vec<2>(0, -10); };
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  for (int step = 1; step <= 10; ++step) {
    const auto result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    // Implicit Euler: v_k = -g h k, x_k = x_0 - g h^2 k (k + 1) / 2.
    EXPECT_NEAR(simulation.state().history.x[0][1], -10 * 1e-4 * step * (step + 1) / 2, 1e-12);
  }
}

class Integrators : public ::testing::TestWithParam<TimeOptions> {};

TEST_P(Integrators, KeepMomentumThroughRemeshing) {
  auto setup = free_square(4);
  setup.time = GetParam();
  setup.time.dt = 0.01;
  setup.time.steps = 8;
  const Operations done = fly_with_remeshing(setup);
  EXPECT_GT(done.splits + done.coarsenings, 10);
}

INSTANTIATE_TEST_SUITE_P(All, Integrators,
                         ::testing::Values(TimeOptions{.integrator = Integrator::implicit_euler},
                                           TimeOptions{.integrator = Integrator::newmark},
                                           TimeOptions{.integrator = Integrator::bdf, .bdf_order = 2}),
                         ::testing::PrintToStringParamName());

/// A body of two materials, one of them `law` with moduli that vary, remeshed as it deforms.
class Laws : public ::testing::TestWithParam<MaterialLaw> {};

TEST_P(Laws, KeepMomentumThroughRemeshing) {
  auto setup = free_square(4);
  std::vector<Vec<2>> rest;
  std::vector<std::array<int, 3>> cells;
  std::vector<int> bodies;
  for (int v = 0; v < setup.mesh.vertex_slots(); ++v) rest.push_back(setup.mesh.rest(v));
  for (int c = 0; c < setup.mesh.cell_slots(); ++c) {
    cells.push_back(setup.mesh.cell(c));
    bodies.push_back(c < setup.mesh.cell_slots() / 2 ? 1 : 2);
  }
  setup.mesh = Mesh<2>(rest, cells, bodies);
  Material& material = setup.materials[2] = setup.materials[1];
  material.law = GetParam();
  if (GetParam() == MaterialLaw::mooney_rivlin)
    material.mooney_rivlin = {.c1 = 1500, .c2 = 300, .log_k = 1e4};
  else
    material.youngs_modulus_at = [](const Vec<3>& X) { return 1e4 * (1 + 5 * X[0]); };
  const Operations done = fly_with_remeshing(setup);
  EXPECT_GT(done.splits, 0);
  EXPECT_GT(done.coarsenings, 0);
}

INSTANTIATE_TEST_SUITE_P(All, Laws,
                         ::testing::Values(MaterialLaw::neo_hookean, MaterialLaw::linear,
                                           MaterialLaw::saint_venant_kirchhoff, MaterialLaw::fixed_corotated,
                                           MaterialLaw::mooney_rivlin),
                         ::testing::PrintToStringParamName());

TEST(Simulation, ImpactWithRemeshingNeverIntersects) {
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
TEST(Simulation, RemeshingStaysOutsideOfObstaclePoints) {
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
      const ClosedSurface<2> boundary = boundary_at(simulation.state().mesh, x);
      for (const auto& p : setup.obstacles.rest) ASSERT_EQ(boundary.winding(p), 0) << "step " << simulation.state().step;
    }
    nearest = std::min(nearest, result.report.min_distance);
    collapses += result.report.collapses.accepted;
  }
  EXPECT_LT(nearest, 2e-3) << "the square never touched a point";
  EXPECT_GT(collapses, 0);
}

TEST(Simulation, FindsWhatIsWrongWithPositions) {
  auto setup = impact();
  setup.obstacles.rest.emplace_back(0.1, -0.02);  // a point
  setup.obstacles.motion.push_back(kNone);
  const Mesh<2>& mesh = setup.mesh;
  const int bodies = mesh.vertex_slots();
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

TEST(Simulation, RefusesToStartInsideOfABody) {
  auto setup = impact();
  linear::Registry registry;
  EXPECT_NO_THROW(Simulation<2>(setup, registry));
  setup.obstacles.rest.emplace_back(0.1, 0.09);
  setup.obstacles.motion.push_back(kNone);
  EXPECT_THROW(Simulation<2>(setup, registry), InputError);
}

/// A state that the history holds and that is not valid: remeshing carries it along, so the step must notice.
TEST(Simulation, KeepsTheMeshWhereARemeshedStateIsNotValid) {
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
    if (!valid) state.history.x[1].tail<4>() << -1, 0.05, 1, 0.05;  // the obstacle, through the body
    simulation.restore(state);
    const auto result = simulation.advance();
    EXPECT_TRUE(result.ok) << result.reason;
    EXPECT_EQ(warnings.find("keeping the mesh as it was") == std::string::npos, valid) << warnings;
    return result.report.splits.accepted;
  };
  EXPECT_GT(splits(true), 0);
  EXPECT_EQ(splits(false), 0);
}

/// The schedule goes on from mesh to mesh, and trials have its stiffness.
TEST(Simulation, AdaptiveStiffnessGoesThroughRemeshing) {
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

TEST(Simulation, HasTheSameBitsForOneAndTwoThreads) {
  const auto run = [](int threads) {
    const ThreadLimit limit(threads);
    auto setup = impact();
    // Cells, surface edges and contacts in more than one block of their loops, else nothing runs in parallel.
    setup.mesh = make_square(18, 0.2);
    setup.obstacles = {};
    for (int i = 0; i <= 300; ++i) {
      setup.obstacles.rest.emplace_back(-0.1 + 0.4 * i / 300, -0.01);
      setup.obstacles.motion.push_back(kNone);
      if (i > 0) setup.obstacles.edges.push_back({i - 1, i});
    }
    setup.time.steps = 3;
    enable_remeshing(setup);
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    int changes = 0;
    while (!simulation.finished()) {
      const auto result = simulation.advance();
      EXPECT_TRUE(result.ok) << result.reason;
      if (!result.ok) break;
      changes += result.report.splits.accepted + result.report.collapses.accepted;
    }
    EXPECT_GT(changes, 0);
    return simulation.state().history;
  };
  const History one = run(1), two = run(2);
  const auto same = [](const VectorX& a, const VectorX& b) {
    return a.size() == b.size() && (a.array() == b.array()).all();
  };
  EXPECT_TRUE(same(one.x[0], two.x[0]));
  EXPECT_TRUE(same(one.v[0], two.v[0]));
}

/// A square that turns and swings in free flight: its matrix changes little from step to step.
struct Flight {
  VectorX x;
  int iterations = 0, factorizations = 0, reused = 0;
};

Flight fly(bool reuse_factors, int resume_after = 0) {
  auto setup = free_square(32);
  setup.initial_velocity = {{1, [](const Vec<2>& X, double) { return Vec<2>(X[1], 0.3 * X[0] - 0.1); }}};
  setup.linear.reuse_factors = reuse_factors;
  linear::Registry registry;
  auto simulation = std::make_unique<Simulation<2>>(setup, registry);
  Flight flight;
  while (!simulation->finished()) {
    const auto step = simulation->advance();
    EXPECT_TRUE(step.ok) << step.reason;
    EXPECT_GE(step.report.linear_solves, step.report.newton_iterations);
    EXPECT_LE(step.report.factorizations + step.report.reused_factors, step.report.linear_solves);
    flight.iterations += step.report.newton_iterations;
    flight.factorizations += step.report.factorizations;
    flight.reused += step.report.reused_factors;
    if (step.report.step != resume_after) continue;
    const State<2> state = simulation->state();
    simulation = std::make_unique<Simulation<2>>(setup, registry);
    simulation->restore(state);
  }
  flight.x = simulation->state().history.x[0];
  return flight;
}

TEST(Simulation, AFactorServesManyStepsAndChangesNothing) {
  const Flight kept = fly(true), anew = fly(false);
  EXPECT_LE(kept.factorizations, 3);
  EXPECT_GT(kept.reused, 5 * kept.factorizations);
  EXPECT_GE(anew.factorizations, anew.iterations);
  EXPECT_EQ(kept.iterations, anew.iterations);
  EXPECT_LE((kept.x - anew.x).lpNorm<Eigen::Infinity>(), 1e-10 * 0.2);
  const Flight resumed = fly(true, 4);
  EXPECT_EQ(kept.x, resumed.x) << "other bits after a restore";
  EXPECT_EQ(kept.factorizations, resumed.factorizations);
}

TEST(Simulation, RefusesWhatRemeshingCannotCarryAlong) {
  linear::Registry registry;
  const auto refused = [&](const auto& setup) {
    try {
      Simulation<2> simulation(setup, registry);
    } catch (const InputError& error) {
      return error.parts().place;
    }
    return std::string();
  };
  auto setup = free_square(2);
  setup.point_tags.assign(setup.mesh.vertex_slots(), 1);
  EXPECT_EQ(refused(setup), "");
  setup.remesh.enabled = true;
  EXPECT_EQ(refused(setup), "/geometry");
  setup.point_tags.clear();
  EXPECT_EQ(refused(setup), "");
  setup.materials[1].density_at = [](const Vec<3>&) { return 1.0; };
  EXPECT_EQ(refused(setup), "/materials");
}

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

TEST(Simulation, StaticPressureReachesTheUniformStretchOfTheClosedForm) {
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
  for (int v = 0; v < state.mesh.vertex_slots(); ++v)
    EXPECT_LE((state.history.x[0].segment<2>(2 * v) - low * state.mesh.rest(v)).norm(), 1e-9);
}

TEST(Simulation, DampingCreepsAsKelvinAndVoigtSay) {
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

TEST(Simulation, DampingAndPressureActInLocalProblemsToo) {
  auto setup = free_square(4);
  // Neither has a resultant on a closed surface.
  setup.damping.push_back({.coefficient = 2e-3});
  for (const int tag : {1, 2, 3, 4}) setup.pressure.push_back({tag, [](const Vec<2>&, double) { return 300; }});
  const Operations done = fly_with_remeshing(setup);
  EXPECT_GT(done.splits + done.coarsenings, 10);
}

TEST(Simulation, StaticContactCarriesTheLoad) {
  auto setup = symmetric_square(4);
  setup.time = {.is_static = true};
  setup.dirichlet.pop_back();  // the bottom rests on an obstacle instead
  setup.obstacles.rest = {{-1, -0.001}, {1, -0.001}};
  setup.obstacles.edges = {{0, 1}};
  setup.obstacles.motion = {kNone, kNone};
  setup.contact = {.enabled = true, .activation_distance = 2e-3, .convergent = true, .barrier_stiffness = 1e5};
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
  const int bodies = state.mesh.vertex_slots();
  EXPECT_NEAR(-(gradient[2 * bodies + 1] + gradient[2 * bodies + 3]), -400, 1e-5);
}

TEST(Simulation, RefusesSurfacesThatIntersectAtTheStart) {
  auto setup = impact();
  setup.obstacles.rest = {{-1, 0.1}, {1, 0.1}};
  linear::Registry registry;
  EXPECT_THROW(Simulation<2>(setup, registry), InputError);
}

TEST(Simulation, DirichletIsExactAtTheEndOfEachStep) {
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

/// The impact, stopped after so few Newton iterations that whole steps fail at first contact.
Setup<2> hurried_impact(TimeOptions time) {
  auto setup = impact();
  setup.time = time;
  setup.time.dt = 0.01;
  setup.time.steps = 6;
  setup.newton.max_iterations = 5;
  return setup;
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
  int cut = 0;
  while (!parts.finished()) {
    result = parts.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    cut += result.report.cut_steps > 0;
    EXPECT_EQ(result.report.step, parts.state().step);
    EXPECT_EQ(parts.state().t, 0.01 * parts.state().step);
    expect_valid(parts);
  }
  EXPECT_GE(cut, 1);
  EXPECT_GE(warnings, cut);
}

INSTANTIATE_TEST_SUITE_P(All, StepCuts,
                         ::testing::Values(TimeOptions{.integrator = Integrator::implicit_euler},
                                           TimeOptions{.integrator = Integrator::newmark},
                                           TimeOptions{.integrator = Integrator::bdf, .bdf_order = 2}),
                         ::testing::PrintToStringParamName());

TEST(Simulation, StaticsAreCutIntoSmallerLoads) {
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
  EXPECT_EQ(simulation.state().t, 1);
  for (int f = 0; f < simulation.state().mesh.facet_slots(); ++f) {
    if (simulation.state().mesh.facet_tag(f) != 4) continue;
    for (const int v : simulation.state().mesh.facet(f))
      EXPECT_EQ(simulation.state().history.x[0][2 * v], simulation.state().mesh.rest(v)[0] + 0.2);
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

TEST(Simulation, HeldVerticesArriveWhereOnlyTheWayIsBlocked) {
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

TEST(Simulation, HeldVerticesThatCannotArriveEndTheStepWithTheReason) {
  linear::Registry registry;
  for (const int cuts : {0, 3}) {
    auto setup = pressed_square(0.3);  // below the line
    setup.time.step_cuts = cuts;
    Simulation<2> simulation(setup, registry);
    const VectorX start = simulation.state().history.x[0];
    const auto result = simulation.advance();
    ASSERT_FALSE(result.ok);
    EXPECT_NE(result.reason.find("held vertices"), std::string::npos) << "reason: " << result.reason;
    // What is in the way is the line below the square.
    for (const char* part : {"limited by the vertex-edge pair ", " obstacle 0 obstacle 1 near (", "the largest residual, "})
      EXPECT_NE(result.reason.find(part), std::string::npos) << part << "; reason: " << result.reason;
    EXPECT_EQ(simulation.state().step, 0);
    EXPECT_EQ(simulation.state().history.x[0], start);
  }
}

/// The line reaches far to one side: the mean of its ends and the vertex is nowhere near the contact.
TEST(Simulation, TheReasonNamesThePlaceOfAContact) {
  linear::Registry registry;
  auto setup = pressed_square(0.3);
  setup.obstacles.rest[1][0] *= 100;
  const auto result = Simulation<2>(setup, registry).advance();
  ASSERT_FALSE(result.ok);
  const auto at = result.reason.find("obstacle 1 near (");
  ASSERT_NE(at, std::string::npos) << result.reason;
  EXPECT_LT(std::abs(std::stod(result.reason.substr(at + 17))), 0.21) << result.reason;
}

TEST(Simulation, TheReasonNamesVerticesOfAProxy) {
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
  for (const char* part : {"its contact pair proxy ", " obstacle 0 obstacle 1 near ("})
    EXPECT_NE(result.reason.find(part), std::string::npos) << part << "; reason: " << result.reason;
}

TEST(Simulation, DirichletMayMoveByLessThanRoundOff) {
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

}  // namespace
}  // namespace itr
