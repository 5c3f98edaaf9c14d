// SPDX-License-Identifier: MIT
// Scenes without contact whose loads, motions or strains are small: whatever dt, modulus and size are, no load is passed
// over and no solve ends for round-off.
#include <gtest/gtest.h>

#include <cmath>

#include "apps/itr/resolution.hpp"
#include "itr/core.hpp"
#include "itr/solver.hpp"
#include "random_tets.hpp"
#include "simulation_scenes.hpp"

namespace itr {
namespace {

constexpr double kGravity = 9.81;

/// A square of 0.2 m with the default tolerances.
Setup<2> plain_square(int n, double modulus) {
  Setup<2> setup;
  setup.mesh = make_square(n, 0.2);
  setup.materials[1] = {.youngs_modulus = modulus, .poisson_ratio = 0.3, .density = 1000};
  return setup;
}

template <int Dim>
void hold(Setup<Dim>& setup, int tag) {
  DirichletCondition<Dim> condition;
  condition.tag = tag;
  condition.components.fill(true);
  condition.displacement = [](const Vec<Dim>&, double) { return Vec<Dim>(Vec<Dim>::Zero()); };
  setup.dirichlet.push_back(condition);
}

/// nx by ny rectangles, each cut in two; their left side is 1, the right one 3, the others 4.
Mesh<2> rectangles(int nx, int ny, double dx, double dy) {
  std::vector<Vec<2>> rest;
  std::vector<std::array<int, 3>> cells;
  for (int j = 0; j <= ny; ++j)
    for (int i = 0; i <= nx; ++i) rest.emplace_back(dx * i, dy * j);
  for (int j = 0; j < ny; ++j)
    for (int i = 0; i < nx; ++i) {
      const int a = (nx + 1) * j + i, b = a + 1, c = b + nx + 1, d = c - 1;
      cells.push_back({a, b, c});
      cells.push_back({a, c, d});
    }
  Mesh<2> mesh(rest, cells, std::vector<int>(cells.size(), 1));
  for (int f = 0; f < mesh.facet_slots(); ++f) {
    const auto [a, b] = mesh.facet(f);
    const double x = (mesh.rest(a)[0] + mesh.rest(b)[0]) / 2;
    mesh.set_facet_tag(f, x < 1e-6 * dx ? 1 : x > dx * (nx - 1e-6) ? 3 : 4);
  }
  return mesh;
}

/// Twenty by one squares of 1 mm, held on the left.
Setup<2> cantilever(double modulus) {
  Setup<2> setup;
  setup.mesh = rectangles(20, 1, 1e-3, 1e-3);
  setup.materials[1] = {.youngs_modulus = modulus, .poisson_ratio = 0.35, .density = 1200};
  hold(setup, 1);
  return setup;
}

template <int Dim>
Vec<Dim> sum_of(const VectorX& field) {
  Vec<Dim> sum = Vec<Dim>::Zero();
  for (Eigen::Index v = 0; v < field.size() / Dim; ++v) sum += field.segment<Dim>(Dim * v);
  return sum;
}

TEST(AtRest, BodiesFallHoweverShortTheSteps) {
  for (const double dt : {1e-3, 1e-6, 1e-7})
    for (const Integrator integrator : {Integrator::implicit_euler, Integrator::bdf, Integrator::newmark}) {
      SCOPED_TRACE(dt);
      auto setup = plain_square(2, 1e6);
      setup.body_acceleration = [](const Vec<2>&, double) { return Vec<2>(0, -kGravity); };
      setup.time = {.integrator = integrator, .dt = dt, .steps = 100};
      setup.consistent_initial_acceleration = integrator == Integrator::newmark;
      linear::Registry registry;
      Simulation<2> simulation(setup, registry);
      for (int i = 0; i < 100; ++i) {
        const auto result = simulation.advance();
        ASSERT_TRUE(result.ok) << result.reason;
      }
      const VectorX& v = simulation.state().history.v[0];
      for (Eigen::Index i = 0; i < v.size(); ++i) EXPECT_NEAR(v[i], i % 2 ? -kGravity * 100 * dt : 0, kGravity * dt);
    }
}

TEST(AtRest, MomentumIsTheImpulseOfASmallLoad) {
  auto setup = plain_square(3, 2e11);
  setup.materials[1].density = 7800;
  setup.neumann.push_back({3, [](const Vec<2>&, double) { return Vec<2>(-5e4, 0); }});
  setup.time = {.integrator = Integrator::bdf, .dt = 1e-7, .steps = 50};
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  for (int i = 0; i < 50; ++i) ASSERT_TRUE(simulation.advance().ok);
  const double impulse = -5e4 * 0.2 * 50 * 1e-7;
  double momentum = 0;
  const auto& [mesh, v] = std::pair(simulation.state().mesh, simulation.state().history.v[0]);
  for (CellId c = 0; c < mesh.cell_slots(); ++c)
    for (const int corner : mesh.cell(c)) momentum += 7800 * mesh.volume(c) / 3 * v[2 * corner];
  EXPECT_NEAR(momentum, impulse, 1e-3 * std::abs(impulse));
}

TEST(AtRest, QuasistaticForcesDoNotDependOnTheLengthOfSteps) {
  VectorX expected;
  for (const double dt : {1.0, 1e-9, 1e-6, 1e3}) {
    SCOPED_TRACE(dt);
    auto setup = plain_square(3, 1e6);
    hold(setup, 1);
    setup.neumann.push_back({3, [](const Vec<2>&, double) { return Vec<2>(0, 1000); }});
    setup.time = {.quasistatic = true, .dt = dt, .steps = 2};
    setup.fields.reaction_forces = true;
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    ASSERT_TRUE(simulation.advance().ok);
    const auto result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    EXPECT_NEAR(sum_of<2>(result.forces.reaction)[1], -200, 200e-9);
    if (expected.size() == 0) expected = result.forces.reaction;
    EXPECT_LE((result.forces.reaction - expected).lpNorm<Eigen::Infinity>(), 1e-9 * expected.lpNorm<Eigen::Infinity>());
  }
}

TEST(AtRest, APluckedCantileverRingsDown) {
  for (const double modulus : {2e9, 2e11}) {
    SCOPED_TRACE(modulus);
    auto setup = cantilever(modulus);
    setup.initial_velocity.push_back({1, [](const Vec<2>& X, double) { return Vec<2>(0, 0.5 * X[0] / 0.02); }});
    setup.time = {.dt = 0.005, .steps = 600};
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    double before = std::numeric_limits<double>::infinity();
    int iterations = 0;
    for (int i = 0; i < 600; ++i) {
      const auto result = simulation.advance();
      ASSERT_TRUE(result.ok) << "step " << i + 1 << ": " << result.reason;
      const double energy = result.report.energy.elastic;
      if (before > 1e-100) {
        ASSERT_LE(energy, before) << "step " << i + 1;
      }
      before = energy;
      iterations += result.report.newton_iterations;
    }
    EXPECT_LE(iterations, 800);
    EXPECT_LT(before, 1e-100);
  }
}

TEST(AtRest, ATurnedEdgeTurnsTheBody) {
  auto setup = plain_square(1, 1e6);
  const double angle = 8 * M_PI / 180;
  setup.dirichlet.push_back({1, {true, true}, [=](const Vec<2>& X, double) {
                               const Vec<2> there(std::cos(angle) * X[0] - std::sin(angle) * X[1],
                                                  std::sin(angle) * X[0] + std::cos(angle) * X[1]);
                               return Vec<2>(there - X);
                             }});
  setup.time = {.quasistatic = true, .dt = 1, .steps = 1};
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const auto result = simulation.advance();
  ASSERT_TRUE(result.ok) << result.reason;
  EXPECT_LE(result.report.newton_iterations, 30);
  EXPECT_LE(result.report.energy.elastic, 1e-20 * 1e6 * 0.04);
}

TEST(AtRest, StiffBodiesCarrySmallLoads) {
  for (const double traction : {1e3, 1.0, 1e-3}) {
    SCOPED_TRACE(traction);
    auto setup = cantilever(2e11);
    setup.neumann.push_back({3, [=](const Vec<2>&, double t) { return Vec<2>(0, traction * t); }});
    setup.time = {.quasistatic = true, .dt = 0.25, .steps = 4};
    setup.fields.reaction_forces = true;
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    for (int i = 1; i <= 4; ++i) {
      const auto result = simulation.advance();
      ASSERT_TRUE(result.ok) << result.reason;
      const double load = traction * 0.25 * i * 1e-3;
      EXPECT_NEAR(sum_of<2>(result.forces.reaction)[1], -load, 1e-6 * load);
      EXPECT_LE(result.report.newton_iterations, 10);
    }
  }
}

/// The guess for each step is wrong by less than what the forces' round-off may hide, and by much more than positions do.
TEST(AtRest, VelocitiesUnderAGrowingLoadAreThoseOfTheirSteps) {
  itr::Setup<2> setup;
  setup.mesh = rectangles(3, 2, 1.7210480736562235, 1.806160334454984);
  setup.materials[1] = {
      .law = MaterialLaw::fixed_corotated, .youngs_modulus = 1.3816e4, .poisson_ratio = 0.45, .density = 2700};
  hold(setup, 1);
  setup.pressure.push_back({3, [](const Vec<2>&, double t) { return -1.1811271925804428e-06 / 90.02 * t; }});
  setup.linear.solvers = {"eigen:lu"};
  setup.time = {.integrator = Integrator::implicit_euler, .dt = 6.43, .steps = 14};
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  while (!simulation.finished()) {
    const auto result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    const History& history = simulation.state().history;
    const Eigen::Map<const VectorX> rest(setup.mesh.rest()[0].data(), history.x[0].size());
    const VectorX mean = (history.x[0] - rest) / result.report.t;
    if (result.report.step <= 5) continue;
    EXPECT_LE((history.v[0] - mean).lpNorm<Eigen::Infinity>(), 2e-3 * mean.lpNorm<Eigen::Infinity>());
  }
}

/// Inertia is all that holds the bar across, and 1e-9 of the forces along it.
TEST(AtRest, LightBarsOnRollersDoNotDriftAside) {
  constexpr double kSize = 1.8e-4, kVelocity = -1e-11;
  itr::Setup<3> setup;
  setup.mesh = make_cubes(
      2, [=](int i, int j, int k) { return Vec<3>(kSize * i, kSize * (j - 0.05 * i * j), kSize * k); },
      [](int, int, int) { return 1; });
  for (FacetId f = 0; f < setup.mesh.facet_slots(); ++f) {
    Vec<3> middle = Vec<3>::Zero();
    for (const int v : setup.mesh.facet(f)) middle += setup.mesh.rest(v) / 3;
    setup.mesh.set_facet_tag(f, middle[0] < 1e-9 ? 1 : middle[0] > 2 * kSize - 1e-9 ? 2 : middle[2] < 1e-9 ? 3 : 4);
  }
  setup.materials[1] = {.youngs_modulus = 2.8e10, .poisson_ratio = 0.3, .density = 1};
  const auto move = [&](int tag, int axis, double velocity) {
    DirichletCondition<3> condition;
    condition.tag = tag;
    condition.components.fill(false);
    condition.components[axis] = true;
    condition.displacement = [=](const Vec<3>&, double t) { return Vec<3>(velocity * t * Vec<3>::Unit(axis)); };
    setup.dirichlet.push_back(condition);
  };
  move(1, 0, kVelocity);
  move(2, 0, 0);
  move(3, 2, 0);
  setup.time = {.integrator = Integrator::newmark, .dt = 7.76e-5, .steps = 10};
  linear::Registry registry;
  Simulation<3> simulation(setup, registry);
  while (!simulation.finished()) {
    const auto result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    const VectorX& x = simulation.state().history.x[0];
    Vec<3> mean = Vec<3>::Zero();
    for (const CellId c : setup.mesh.live_cells())
      for (const int v : setup.mesh.cell(c)) mean += setup.mesh.volume(c) / 4 * (x.segment<3>(3 * v) - setup.mesh.rest(v));
    EXPECT_LE(std::abs(mean[1] / setup.mesh.total_volume()), 1e-3 * std::abs(kVelocity) * result.report.t);
  }
}

TEST(AtRest, ASteelCubeStandsUnderItsWeight) {
  for (const double size : {1e-2, 1e-3, 1e-4}) {
    SCOPED_TRACE(size);
    itr::Setup<3> setup;
    setup.mesh = make_cubes(
        3, [=](int i, int j, int k) { return Vec<3>(Vec<3>(i, j, k) * (size / 3)); }, [](int, int, int) { return 1; });
    for (FacetId f = 0; f < setup.mesh.facet_slots(); ++f) {
      double top = 0;
      for (const int v : setup.mesh.facet(f)) top = std::max(top, setup.mesh.rest(v)[1]);
      setup.mesh.set_facet_tag(f, top < 1e-9 * size ? 1 : 2);
    }
    setup.materials[1] = {.youngs_modulus = 2e11, .poisson_ratio = 0.3, .density = 7800};
    hold(setup, 1);
    setup.body_acceleration = [](const Vec<3>&, double) { return Vec<3>(0, -kGravity, 0); };
    setup.time = {.is_static = true};
    setup.fields.reaction_forces = true;
    linear::Registry registry;
    Simulation<3> simulation(setup, registry);
    const auto result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    const double weight = 7800 * kGravity * size * size * size;
    EXPECT_NEAR(sum_of<3>(result.forces.reaction)[1], weight, 1e-6 * weight);
  }
}

/// A program's functions have no key: the error says what they prescribe. The state stays.
TEST(Values, OfProgramsThatAreNoneEndTheStepBeforeItIsTaken) {
  auto setup = plain_square(2, 1e6);
  hold(setup, 1);
  setup.dirichlet[0].displacement = [](const Vec<2>&, double t) { return Vec<2>(t > 0.015 ? std::nan("") : 0.1 * t, 0); };
  setup.time = {.quasistatic = true, .dt = 0.01, .steps = 3};
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  ASSERT_TRUE(simulation.advance().ok);
  const VectorX x = simulation.state().history.x[0];
  EXPECT_THROW(simulation.advance(), InputError);
  EXPECT_EQ(simulation.state().step, 1);
  EXPECT_EQ(simulation.state().history.x[0], x);
}

TEST(Values, OfMaterialsThatAreNoneAreNamedWithTheirPlace) {
  const auto wrong = [](double value) { return [value](const Vec<3>& X) { return X[0] > 0.1 ? value : 0.3; }; };
  const auto reason = [&](const std::function<void(Material&)>& change) -> std::string {
    auto setup = plain_square(2, 1e6);
    change(setup.materials[1]);
    linear::Registry registry;
    try {
      Simulation<2>(setup, registry).advance();
    } catch (const InputError& error) {
      return error.parts().place;
    }
    return "none";
  };
  EXPECT_EQ(reason([](Material&) {}), "none");
  EXPECT_EQ(reason([&](Material& m) { m.youngs_modulus_at = wrong(std::nan("")); }), "E");
  for (const double value : {-1.0, 0.0})
    EXPECT_EQ(reason([&](Material& m) { m.youngs_modulus_at = wrong(value); }), "E") << value;
  for (const double value : {-1.0, 0.5, HUGE_VAL})
    EXPECT_EQ(reason([&](Material& m) { m.poisson_ratio_at = wrong(value); }), "nu") << value;
  for (const double value : {0.0, std::nan("")})
    EXPECT_EQ(reason([&](Material& m) { m.density_at = wrong(value); }), "rho") << value;
}

TEST(Resolution, IsToldWhereStepsOrStrainsAreBelowIt) {
  const auto count = [](double dt, double traction, double modulus) {
    auto setup = plain_square(1, modulus);
    setup.neumann.push_back({3, [=](const Vec<2>&, double) { return Vec<2>(traction, 0); }});
    setup.time.dt = dt;
    linear::Registry registry;
    std::vector<std::string> found;
    cli::find_unresolved(Simulation<2>(setup, registry), found);
    return found.size();
  };
  EXPECT_EQ(count(1e-3, 1, 1e6), 0u);
  EXPECT_EQ(count(1e-7, 1, 1e6), 1u) << "a step moves the square by 5e-17 m";
  EXPECT_EQ(count(1e-3, 1, 1e13), 1u) << "a strain of 1e-13";
  EXPECT_EQ(count(1e-7, 0, 1e6), 0u) << "nothing acts";
}

TEST(Resolution, OfALongStepIsThatOfTheBodyAtRestWhereConditionsHoldIt) {
  for (const bool is_held : {false, true}) {
    auto setup = plain_square(1, 1e6);
    setup.neumann.push_back({3, [](const Vec<2>&, double) { return Vec<2>(3e-7, 0); }});
    if (is_held) hold(setup, 1);
    setup.time.dt = 10;
    linear::Registry registry;
    std::vector<std::string> found;
    cli::find_unresolved(Simulation<2>(setup, registry), found);
    EXPECT_EQ(found.size(), is_held ? 1u : 0u);
  }
}

/// Forces on points and strains of heat count as tractions do.
TEST(Resolution, IsThatOfAllThatActs) {
  const auto count = [](double force, double strain) {
    auto setup = plain_square(1, 1e6);
    hold(setup, 1);
    VectorX forces = VectorX::Zero(2 * setup.mesh.num_vertices());
    forces[forces.size() - 1] = force;
    setup.nodal_loads.push_back(point_forces(setup.mesh, forces));
    setup.materials[1].eigenstrain = [=](const Vec<3>&, double) -> Mat<3> { return strain * Mat<3>::Identity(); };
    setup.time.quasistatic = true;
    linear::Registry registry;
    std::vector<std::string> found;
    cli::find_unresolved(Simulation<2>(setup, registry), found);
    return found.size();
  };
  EXPECT_EQ(count(0, 0), 0u);
  EXPECT_EQ(count(1, 0), 0u);
  EXPECT_EQ(count(1e-7, 0), 1u) << "a strain of 1e-13";
  EXPECT_EQ(count(0, 1e-3), 0u);
  EXPECT_EQ(count(0, 1e-14), 1u);
}

/// Motions between the first step and the last one count where these two move nothing.
TEST(Resolution, OfWhatMovesLaterIsThatOfItsMotion) {
  for (const double motion : {1e-2, 1e-14}) {
    auto setup = plain_square(1, 1e6);
    hold(setup, 1);
    setup.dirichlet.push_back({3, {true, true}, [=](const Vec<2>&, double t) { return Vec<2>(t > 1.5 ? motion : 0, 0); }});
    setup.time = {.quasistatic = true, .dt = 1, .steps = 3};
    linear::Registry registry;
    std::vector<std::string> found;
    cli::find_unresolved(Simulation<2>(setup, registry), found);
    EXPECT_EQ(found.size(), motion < 1e-10 ? 1u : 0u);
  }
}

TEST(Resolution, WithoutInertiaIsNoMatterOfAVelocity) {
  auto setup = plain_square(1, 1e6);
  setup.initial_velocity.push_back({1, [](const Vec<2>&, double) { return Vec<2>(1, 0); }});
  setup.time.quasistatic = true;
  linear::Registry registry;
  std::vector<std::string> found;
  cli::find_unresolved(Simulation<2>(setup, registry), found);
  EXPECT_TRUE(found.empty());
}

/// A stiff body that flies has no strain, and moves far.
TEST(Resolution, IsNoMatterOfStrainsThatAFlightHasNot) {
  const auto count = [](double modulus, bool is_held, bool has_ground) {
    auto setup = plain_square(1, modulus);
    setup.materials[1].density = 1;
    setup.body_acceleration = [](const Vec<2>&, double) { return Vec<2>(0, -10); };
    setup.initial_velocity.push_back({1, [](const Vec<2>&, double) { return Vec<2>(1e-6, 0); }});
    if (is_held) hold(setup, 1);
    if (has_ground) {
      setup.contact.enabled = true;
      setup.obstacles.rest = {{-9, -1}, {9, -1}};
      setup.obstacles.edges = {{0, 1}};
      setup.obstacles.motion = {kNone, kNone};
    }
    setup.time.dt = 1e-2;
    linear::Registry registry;
    std::vector<std::string> found;
    cli::find_unresolved(Simulation<2>(setup, registry), found);
    return found.size();
  };
  EXPECT_EQ(count(1e16, false, false), 0u);
  EXPECT_EQ(count(1e16, true, false), 1u) << "gravity strains it by 1e-15";
  EXPECT_EQ(count(1e16, false, true), 1u) << "it lands";
}

/// Over short steps the positions have no digits for the accelerations that belong to reactions.
TEST(Reactions, ThatPositionsDoNotResolveAreSaid) {
  for (const double dt : {1e-11, 1e-3}) {
    SCOPED_TRACE(dt);
    auto setup = plain_square(2, 1e3);
    hold(setup, 1);
    setup.initial_velocity.push_back({1, [](const Vec<2>& X, double) { return Vec<2>(0.1 * X[0], 0); }});
    setup.fields.reaction_forces = true;
    setup.time.dt = dt;
    setup.time.steps = 6;
    int warnings = 0;
    linear::Registry registry;
    Simulation<2> simulation(setup, registry,
                             Logger([&](LogLevel level, std::string_view) { warnings += level == LogLevel::warning; }));
    while (simulation.state().step < setup.time.steps) ASSERT_TRUE(simulation.advance().ok);
    EXPECT_EQ(warnings, dt < 1e-6 ? 1 : 0);
  }
}

}  // namespace
}  // namespace itr
