// SPDX-License-Identifier: MIT
// Whole steps in free flight, with and without remeshing: momentum, threads, kept factors.
#include <gtest/gtest.h>

#include <memory>

#include "advance.hpp"
#include "core/parallel.hpp"
#include "energy/inertia.hpp"
#include "itr/core.hpp"
#include "itr/solver.hpp"
#include "linear/forwarding.hpp"
#include "simulation/step_problem.hpp"
#include "simulation_scenes.hpp"

namespace itr {

inline void PrintTo(MaterialLaw law, std::ostream* out) {
  constexpr const char* kNames[] = {"NeoHookean", "LinearElasticity", "SaintVenant", "FixedCorotational", "MooneyRivlin"};
  *out << kNames[static_cast<int>(law)];
}

namespace {

Vec<2> momentum(const Simulation<2>& simulation) {
  const auto& state = simulation.state();
  const CellSet<2> cells = whole_mesh(state.mesh, simulation.setup().obstacles.rest);
  const VectorX& v = state.history.v[0];
  VectorX product = VectorX::Zero(v.size());
  InertiaEnergy<2>(cells, simulation.setup().materials, MassKind::consistent, VectorX::Zero(v.size()))
      .add_mass_product(v, product);
  Vec<2> sum = Vec<2>::Zero();
  for (int i = 0; i < state.mesh.num_vertices(); ++i) sum += product.segment<2>(2 * i);
  return sum;
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
    const StepResult result = advance(simulation);
    EXPECT_LE(result.report.newton_iterations, step == 1 ? 2 : 0) << "flight is foreseen";
    // Implicit Euler: v_k = -g h k, x_k = x_0 - g h^2 k (k + 1) / 2.
    EXPECT_NEAR(simulation.state().history.x[0][1], -10 * 1e-4 * step * (step + 1) / 2, 1e-12);
  }
}

/// The gradient where flight leads is below any tolerance in so short a step, but it is all that acts.
TEST(Simulation, ForcesActHoweverShortTheStep) {
  auto setup = free_square(2);
  setup.newton = {};
  setup.time = {.dt = 1e-7, .steps = 3};
  setup.body_acceleration = [](const Vec<2>&, double) { return Vec<2>(0, -10); };
  setup.initial_velocity.push_back({1, [](const Vec<2>&, double) { return Vec<2>(1, 0); }});
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  while (!simulation.finished()) {
    const StepResult result = advance(simulation);
  }
  EXPECT_NEAR(simulation.state().history.v[0][1], -3e-6, 1e-8);
}

/// Newton may begin elsewhere than the step, but the step is the same.
TEST(Simulation, EndsWhereItEndsWithoutForesight) {
  auto setup = impact();
  setup.newton.step_tolerance = 1e-11;
  setup.time.steps = 20;
  auto blind = setup;
  blind.newton.indefinite = IndefiniteHessian::accept;  // begins where the step does
  linear::Registry registry;
  Simulation<2> simulation(setup, registry), other(blind, registry);
  while (!simulation.finished()) {
    const auto result = simulation.advance(), expected = other.advance();
    ASSERT_TRUE(result.ok && expected.ok) << result.reason << expected.reason;
  }
  const VectorX &x = simulation.state().history.x[0], &y = other.state().history.x[0];
  EXPECT_LE((x - y).lpNorm<Eigen::Infinity>(), 1e-9 * y.lpNorm<Eigen::Infinity>());
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
  for (int v = 0; v < setup.mesh.node_slots(); ++v) rest.push_back(setup.mesh.rest(v));
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

/// Cells, surface edges and contacts are in more than one block of their loops, and pairs are found by trees.
Setup<2> large_impact() {
  auto setup = impact();
  setup.mesh = make_square(18, 0.2);
  setup.obstacles = {};
  for (int i = 0; i <= 300; ++i) {
    setup.obstacles.rest.emplace_back(-0.1 + 0.4 * i / 300, -0.01);
    setup.obstacles.motion.push_back(kNone);
    if (i > 0) setup.obstacles.edges.push_back({i - 1, i});
  }
  setup.time.steps = 3;
  return setup;
}

TEST(MeshScope, IsSharedWhileTheMeshStays) {
  auto setup = impact();
  linear::Registry registry;
  const auto solver = registry.create("eigen");
  const Mesh<2> mesh = Simulation<2>(setup, registry).state().mesh;
  ProblemCache<2> cache(*solver);
  const auto first = cache.scope_of(setup, mesh);
  EXPECT_EQ(cache.scope_of(setup, Mesh<2>(mesh)), first);
  Mesh<2> tagged = mesh;
  tagged.set_facet_tag(0, tagged.facet_tag(0) + 1);
  EXPECT_NE(cache.scope_of(setup, tagged), first);
  std::vector<Vec<2>> rest;
  std::vector<Mesh<2>::Cell> cells;
  for (VertexId v = 0; v < mesh.node_slots(); ++v) rest.push_back(mesh.rest(v));
  for (CellId c = 0; c < mesh.cell_slots(); ++c) cells.push_back(mesh.cell(c));
  rest[0].x() -= 1e-9;
  EXPECT_NE(cache.scope_of(setup, Mesh<2>(rest, cells, std::vector<int>(cells.size(), 1))), first);
  const auto before = cache.scope_of(setup, mesh);
  setup.obstacles.rest[0].y() -= 1e-9;
  EXPECT_NE(cache.scope_of(setup, mesh), before);
}

/// Caches do not show: a simulation that begins at the step has the same bits.
TEST(Simulation, OnAMeshThatStaysHasTheBitsOfAFreshOne) {
  const auto setup = large_impact();
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  double nearest = 1;
  while (!simulation.finished()) {
    Simulation<2> fresh(setup, registry);
    fresh.restore(State<2>(simulation.state()));
    const auto one = simulation.advance(), two = fresh.advance();
    ASSERT_TRUE(one.ok && two.ok) << one.reason << two.reason;
    EXPECT_EQ(simulation.state().history.x[0], fresh.state().history.x[0]) << "step " << simulation.state().step;
    EXPECT_EQ(one.report.min_distance, two.report.min_distance);
    nearest = std::min(nearest, one.report.min_distance);
  }
  EXPECT_LT(nearest, setup.contact.dhat) << "nothing touched";
}

TEST(Simulation, HasTheSameBitsForOneAndTwoThreads) {
  const auto run = [](int threads) {
    const ThreadLimit limit(threads);
    auto setup = large_impact();
    enable_remeshing(setup);
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    int changes = 0;
    while (!simulation.finished()) {
      const StepReport report = advance(simulation).report;
      changes += report.splits.accepted + report.collapses.accepted;
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

/// Says that its factors cost nothing, so that none is worth serving another matrix.
class Cheap final : public linear::Forwarding {
 public:
  explicit Cheap(std::unique_ptr<linear::Solver> solver) : solver_(std::move(solver)) {}
  std::string_view name() const override { return "cheap"; }
  linear::Statistics statistics() const override { return {.factor_nonzeros = 1, .flops = 1}; }
  linear::Outcome analyze(const linear::SparsityPattern& pattern, const linear::AnalyzeHints& hints) override {
    return solver_->analyze(pattern, hints);
  }
  linear::Outcome factorize(std::span<const double> values) override { return solver_->factorize(values); }
  linear::SolveReport solve(std::span<const double> B, std::span<double> X, int columns, double asked) override {
    return solver_->solve(B, X, columns, asked);
  }

 private:
  const linear::Solver& current() const override { return *solver_; }
  std::unique_ptr<linear::Solver> solver_;
};

/// A square that turns and swings in free flight: its matrix changes little from step to step.
struct Flight {
  VectorX x;
  int iterations = 0, factorizations = 0, reused = 0;
};

Flight fly(bool reuse_factors, int resume_after = 0) {
  auto setup = free_square(32);
  setup.initial_velocity = {{1, [](const Vec<2>& X, double) { return Vec<2>(X[1], 0.3 * X[0] - 0.1); }}};
  linear::Registry registry;
  if (!reuse_factors) {
    linear::BackendInfo info;
    info.name = "cheap";
    info.available = true;
    registry.add(info, [&](const linear::SolverOptions&) { return std::make_unique<Cheap>(registry.create("eigen:ldlt")); });
    setup.linear.solvers = {"cheap"};
  }
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

TEST(Simulation, WhatPointsHoldStaysHeldWhereTheMeshChanges) {
  const auto end_of = [](bool by_points) {
    auto setup = free_square(3);
    setup.time = {.quasistatic = true, .dt = 0.1, .steps = 2};
    setup.body_acceleration = [](const Vec<2>&, double) { return Vec<2>(4, -9); };
    setup.dirichlet.push_back({9, {true, false}, [](const Vec<2>& X, double t) { return Vec<2>(0.1 * t * X[1], 0); }});
    setup.dirichlet.push_back({3, {false, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }});
    for (FacetId f = 0; f < setup.mesh.facet_slots(); ++f) {
      if (setup.mesh.facet_tag(f) != 1) continue;  // on the left
      if (by_points)
        for (const VertexId v : setup.mesh.facet(f)) setup.mesh.set_vertex_tag(v, 9);
      else
        setup.mesh.set_facet_tag(f, 9);
    }
    setup.remesh.enabled = true;
    setup.remesh.split.acceptance_tolerance = 1e-4;
    setup.remesh.collapse.enabled = false;
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    while (!simulation.finished()) advance(simulation);
    return simulation.state();
  };
  const State<2> by_points = end_of(true), by_facets = end_of(false);
  ASSERT_GT(by_points.mesh.num_vertices(), 16);
  EXPECT_EQ(by_points.history.x[0], by_facets.history.x[0]);
  int held = 0;
  for (VertexId v = 0; v < by_points.mesh.node_slots(); ++v)
    if (by_points.mesh.rest(v)[0] == 0) held += by_points.mesh.vertex_tag(v) == 9;
  EXPECT_GT(held, 4);
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
  setup.remesh.enabled = true;
  EXPECT_EQ(refused(setup), "");
  setup.materials[1].density_at = [](const Vec<3>&) { return 1.0; };
  EXPECT_EQ(refused(setup), "/materials");
}

TEST(Simulation, DampingAndPressureActInLocalProblemsToo) {
  auto setup = free_square(4);
  // Neither has a resultant on a closed surface.
  setup.damping.push_back({.coefficient = 2e-3});
  for (const int tag : {1, 2, 3, 4}) setup.pressure.push_back({tag, [](const Vec<2>&, double) { return 300; }});
  const Operations done = fly_with_remeshing(setup);
  EXPECT_GT(done.splits + done.coarsenings, 10);
}

/// Held dofs advance past all pairs that a body meets one after the other on a round obstacle: bounds on their gaps turn the
/// step. Iterations that each end at the next pair were 36.
TEST(Simulation, IsPressedOntoARoundObstacleInFewIterations) {
  auto setup = free_square(32);
  constexpr int kSegments = 64;
  for (int i = 0; i <= kSegments; ++i) {
    const double x = 0.2 * i / kSegments;
    setup.obstacles.rest.emplace_back(x, -0.001 - 2 * (x - 0.1) * (x - 0.1));
    setup.obstacles.motion.push_back(kNone);
    if (i > 0) setup.obstacles.edges.push_back({i - 1, i});
  }
  setup.contact = {.enabled = true, .dhat = 1e-4, .convergent = true};
  setup.time = {.quasistatic = true, .dt = 1, .steps = 1};
  setup.newton.gradient_tolerance = setup.newton.first_gradient_tolerance = 1e-9;
  setup.dirichlet.push_back({4, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, -0.02); }});
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const StepReport report = advance(simulation).report;
  EXPECT_GT(report.energy.contact, 0);
  EXPECT_LE(report.newton_iterations, 20);
}

}  // namespace
}  // namespace itr
