// SPDX-License-Identifier: MIT
// Error bars: what they add to energies, forces and displacements is what a finer space, a smaller d-hat or more iterations
// give.
#include "simulation/error_estimator.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "energy/contact/retraction.hpp"
#include "itr/simulation.hpp"
#include "itr/solver.hpp"
#include "mesh/refine.hpp"
#include "rings.hpp"
#include "simulation_scenes.hpp"

namespace itr {
namespace {

constexpr double kSize = 0.2;
constexpr int kMesh = static_cast<int>(ErrorSource::mesh), kDhat = static_cast<int>(ErrorSource::dhat),
              kSolver = static_cast<int>(ErrorSource::solver), kTime = static_cast<int>(ErrorSource::time);

/// A square held on the left and moved on the right, without inertia.
itr::Setup<2> pulled(MaterialLaw law, const Vec<2>& motion) {
  itr::Setup<2> setup;
  setup.mesh = make_square(4, kSize);
  setup.materials[1] = {.law = law, .youngs_modulus = 1e4, .poisson_ratio = 0.3, .density = 1000};
  setup.time = {.quasistatic = true, .dt = 1, .steps = 1};
  setup.newton.step_tolerance = 1e-13;
  setup.newton.gradient_tolerance = setup.newton.first_gradient_tolerance = 0;
  setup.dirichlet = {{1, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }},
                     {3, {true, true}, [motion](const Vec<2>&, double) { return motion; }}};
  setup.fields.reaction_forces = setup.fields.contact_forces = true;
  setup.fields.curves = {{.name = "right", .surfaces = {3}}};
  setup.fields.points = {{.name = "corner", .rest = {kSize / 2, kSize, 0}}};
  setup.fields.error_bars = true;
  return setup;
}

/// Results of one step.
struct Outcome {
  double energy = 0;
  Vec<2> force, point;
  ErrorReport errors;
  ForceCurvePoint curve;
  PointValue at_point;
};

Outcome run(const itr::Setup<2>& setup) {
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const StepResult result = simulation.advance();
  EXPECT_TRUE(result.ok) << result.reason;
  Outcome outcome;
  outcome.energy = result.report.energy.total;
  outcome.errors = result.report.errors;
  simulation.observe([&](const FrameView<2>& frame) {
    outcome.curve = frame.asked->curves.at(0);
    outcome.at_point = frame.asked->points.at(0);
  });
  outcome.force = Vec<2>(outcome.curve.kinds[3].data());
  outcome.point = Vec<2>(outcome.at_point.u.data());
  EXPECT_EQ(outcome.errors.no_bar, "");
  return outcome;
}

/// Expects that what the bars of the mesh add to `rough` leads to `fine`. Iterations end where they add a thousandth of the
/// energy's error: motions are known to the root of that, locally to a few times as much.
void expect_leads_to(const Outcome& rough, const Outcome& fine) {
  constexpr double kEnergy = 0.01, kForce = 0.1, kPoint = 0.25;
  const double energy = fine.energy - rough.energy;
  EXPECT_NEAR(rough.errors.energy[kMesh], energy, kEnergy * std::abs(energy));
  const Vec<2> force = fine.force - rough.force, point = fine.point - rough.point;
  EXPECT_LE((Vec<2>(rough.curve.errors.at(kMesh)[3].data()) - force).norm(), kForce * force.norm());
  EXPECT_LE((Vec<2>(rough.at_point.errors.at(kMesh).data()) - point).norm(), kPoint * point.norm());
}

TEST(ErrorEstimator, FindsWhatQuadraticElementsGainOnALinearProblem) {
  itr::Setup<2> setup = pulled(MaterialLaw::linear, {0.01, 0.005});
  const Outcome linear = run(setup);
  setup.order = {{1, 2}};
  const Outcome quadratic = run(setup);
  EXPECT_LT(quadratic.energy, 0.99 * linear.energy);
  expect_leads_to(linear, quadratic);
}

TEST(ErrorEstimator, FindsWhatRefinedQuadraticElementsGainOnALinearProblem) {
  itr::Setup<2> setup = pulled(MaterialLaw::linear, {0.01, 0.005});
  setup.order = {{1, 2}};
  const Outcome rough = run(setup);
  setup.mesh = refine_uniformly(setup.mesh);
  const Outcome fine = run(setup);
  expect_leads_to(rough, fine);
}

TEST(ErrorEstimator, FindsNothingWhereTheSolutionIsInTheSpace) {
  for (const int order : {1, 2}) {
    itr::Setup<2> setup = pulled(MaterialLaw::neo_hookean, Vec<2>(0, 0));
    setup.order = {{1, order}};
    setup.dirichlet.clear();
    for (const int side : {1, 2, 3, 4})
      setup.dirichlet.push_back(
          {side, {true, true}, [](const Vec<2>& X, double) { return Vec<2>(0.1 * X[0] + 0.05 * X[1], -0.02 * X[0]); }});
    const Outcome outcome = run(setup);
    for (int s = 0; s < kErrorSources; ++s) {
      EXPECT_LE(std::abs(outcome.errors.energy[s]), 1e-13 * outcome.energy) << order << ' ' << s;
      EXPECT_LE(Vec<2>(outcome.curve.errors.at(s)[3].data()).norm(), 1e-7 * outcome.force.norm()) << order << ' ' << s;
      EXPECT_LE(Vec<2>(outcome.at_point.errors.at(s).data()).norm(), 1e-9 * kSize) << order << ' ' << s;
    }
  }
}

/// A square that an obstacle presses onto another one.
itr::Setup<2> pressed(double dhat) {
  itr::Setup<2> setup = pulled(MaterialLaw::neo_hookean, Vec<2>(0, 0));
  setup.dirichlet.resize(1);
  setup.dirichlet[0].tag = 2;
  setup.obstacles.rest = {{-0.1, kSize + 1e-3}, {0.13, kSize + 1e-3}};
  setup.obstacles.edges = {{0, 1}};
  setup.obstacles.motion = {0, 0};
  setup.obstacles.motions = {[](const Vec<2>&, double t) { return Vec<2>(0, -0.011 * t); }};
  setup.contact = {.enabled = true, .dhat = dhat, .convergent = true, .barrier_stiffness = 1e4};
  setup.fields.curves = {{.name = "plate", .obstacle_vertices = {0, 1}}};
  return setup;
}

/// The finite difference of the adjoint's theory: forces by another d-hat are those that the derivative promises.
TEST(ErrorEstimator, HasTheDerivativeByDhat) {
  constexpr double kDhat0 = 4e-4, kChange = 1e-3;
  const Outcome here = run(pressed(kDhat0)), nearer = run(pressed((1 - kChange) * kDhat0));
  const double energy = (nearer.energy - here.energy) / kChange;
  EXPECT_NEAR(here.errors.energy[kDhat], energy, 0.01 * std::abs(energy));
  const Vec<2> force = (nearer.force - here.force) / kChange;
  EXPECT_NEAR(here.curve.errors.at(kDhat)[3][1], force[1], 0.02 * std::abs(force[1]));
  EXPECT_LT(here.errors.energy[kDhat], 0);  // a bias of known sign
}

TEST(ErrorEstimator, FindsWhatTheSolverLeft) {
  itr::Setup<2> setup = pulled(MaterialLaw::neo_hookean, {0.04, 0.02});
  const Outcome exact = run(setup);
  setup.newton.step_tolerance = 1e-2;
  setup.newton.force_tolerance = 0;
  const Outcome loose = run(setup);
  ASSERT_GT((loose.point - exact.point).norm(), 1e-9);
  const Vec<2> point = exact.point - loose.point;
  EXPECT_LE((Vec<2>(loose.at_point.errors.at(kSolver).data()) - point).norm(), 0.2 * point.norm());
}

TEST(ErrorEstimator, SaysWhyThereIsNoBar) {
  itr::Setup<2> setup = pulled(MaterialLaw::neo_hookean, {0.01, 0});
  setup.lump_mass = true;
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const StepResult result = simulation.advance();
  ASSERT_TRUE(result.ok);
  EXPECT_EQ(result.report.errors.no_bar, "the mass is lumped");
  EXPECT_TRUE(result.errors.sources.empty());
}

/// A quarter of a ring that is widened within another one, by averaged gaps.
itr::Setup<2> widened() {
  itr::Setup<2> setup = quarter_rings({{0.4, 0.6, 6, 2}, {0.602, 0.8, 7, 2}});
  for (const FacetId f : setup.mesh.live_facets()) {
    const auto& [a, b] = setup.mesh.facet(f);
    const double radius = (setup.mesh.rest(a).norm() + setup.mesh.rest(b).norm()) / 2;
    if (radius < 0.42) setup.mesh.set_facet_tag(f, 3);
    if (radius > 0.78) setup.mesh.set_facet_tag(f, 4);
  }
  for (const int body : {1, 2}) setup.materials[body] = {.youngs_modulus = 1e6, .poisson_ratio = 0.3, .density = 1};
  setup.dirichlet.push_back({3, {true, true}, [](const Vec<2>& X, double) { return Vec<2>(0.05 * X); }});
  setup.time = {.quasistatic = true, .dt = 1, .steps = 1};
  setup.contact = {.enabled = true, .dhat = 1e-4, .average_gaps = true, .convergent = true};
  setup.fields.reaction_forces = setup.fields.contact_forces = true;
  setup.fields.curves = {{.name = "inner", .surfaces = {3}}};
  setup.fields.points = {{.name = "corner", .rest = {0.8, 0, 0}}};
  setup.fields.error_bars = true;
  setup.choose_defaults();
  EXPECT_TRUE(setup.proxy);
  return setup;
}

TEST(ErrorEstimator, HasTheDerivativeByTheWidthOfAveragedGaps) {
  constexpr double kChange = 1e-3;
  itr::Setup<2> setup = widened();
  const Outcome here = run(setup);
  auto retraction = std::make_shared<Retraction>(*setup.proxy->retraction);
  for (double& width : retraction->width) width *= 1 - kChange;
  setup.proxy->retraction = retraction;
  const Outcome narrower = run(setup);
  const double energy = (narrower.energy - here.energy) / kChange;
  EXPECT_NEAR(here.errors.energy[kDhat], energy, 0.02 * std::abs(energy));
}

/// Blocks without Poisson's effect that a motion presses together evenly: the solution is linear in each. Curves of the
/// finer space must feel the pressure on their edges, or bars would tell of points that dent. A disc far away makes the
/// surfaces retract.
TEST(ErrorEstimator, FindsNothingUnderEvenPressureOfAveragedGaps) {
  constexpr int kAround = 12, kColumns = 21;
  std::vector<Vec<2>> rest;
  std::vector<std::array<int, 3>> cells;
  std::vector<int> bodies;
  for (const int body : {1, 2}) {
    const int first = static_cast<int>(rest.size());
    for (int j = 0; j < 3; ++j)
      for (int i = 0; i < kColumns; ++i) rest.emplace_back(0.04 * i, 0.05 * j + (body == 2 ? 0.101 : 0));
    for (int j = 0; j < 2; ++j)
      for (int i = 0; i + 1 < kColumns; ++i) {
        const int a = first + kColumns * j + i;
        cells.push_back({a, a + 1, a + kColumns + 1});
        cells.push_back({a, a + kColumns + 1, a + kColumns});
      }
    bodies.insert(bodies.end(), 4 * (kColumns - 1), body);
  }
  const int center = static_cast<int>(rest.size());
  rest.emplace_back(0, 5);
  for (int i = 0; i < kAround; ++i) {
    const double angle = 2 * std::numbers::pi * i / kAround;
    rest.emplace_back(0.2 * std::cos(angle), 5 + 0.2 * std::sin(angle));
    cells.push_back({center, center + 1 + i, center + 1 + (i + 1) % kAround});
    bodies.push_back(3);
  }
  itr::Setup<2> setup;
  setup.mesh = Mesh<2>(rest, cells, bodies);
  for (const FacetId f : setup.mesh.live_facets()) {
    const Vec<2> middle = (setup.mesh.rest(setup.mesh.facet(f)[0]) + setup.mesh.rest(setup.mesh.facet(f)[1])) / 2;
    if (middle[1] == 0 || middle[1] > 1) setup.mesh.set_facet_tag(f, 1);
    if (std::abs(middle[1] - 0.201) < 1e-9) setup.mesh.set_facet_tag(f, 2);
  }
  for (const int body : {1, 2, 3}) setup.materials[body] = {.youngs_modulus = 1e6, .poisson_ratio = 0, .density = 1};
  setup.dirichlet = {{1, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }},
                     {2, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, -0.003); }}};
  setup.time = {.quasistatic = true, .dt = 1, .steps = 1};
  setup.contact = {.enabled = true, .dhat = 1e-5, .average_gaps = true, .convergent = true};
  setup.fields.reaction_forces = setup.fields.contact_forces = setup.fields.error_bars = true;
  setup.fields.curves = {{.name = "top", .surfaces = {2}}};
  setup.fields.points = {{.name = "corner", .rest = {0, 0.201, 0}}};
  setup.choose_defaults();
  ASSERT_TRUE(setup.proxy);
  const Outcome outcome = run(setup);
  ASSERT_GT(std::abs(outcome.force[1]), 1000);
  EXPECT_LE(std::abs(outcome.errors.energy[kMesh]), 0.02 * outcome.energy);
  EXPECT_LE(std::abs(outcome.curve.errors.at(kMesh)[3][1]), 0.02 * std::abs(outcome.force[1]));
}

TEST(ErrorEstimator, ChangesNoResult) {
  for (itr::Setup<2> setup : {pressed(4e-4), widened()}) {
    const Outcome with = run(setup);
    setup.fields.error_bars = false;
    const Outcome without = run(setup);
    EXPECT_EQ(with.energy, without.energy);
    EXPECT_EQ(with.force, without.force);
    EXPECT_FALSE(without.errors.is_asked);
    EXPECT_TRUE(without.curve.errors.empty());
  }
}

/// A corner's displacements and a reaction at multiples of a time, with the estimates of what steps put them off by.
struct Motion {
  std::vector<Vec<2>> points, forces, error_of_points, error_of_forces;
};

constexpr double kStep = 0.005;  ///< [s]; the slowest period of a square on a wall has about 100

/// A square on a wall that is shaken.
itr::Setup<2> shaken(Integrator integrator) {
  itr::Setup<2> setup = pulled(MaterialLaw::neo_hookean, Vec<2>(0, 0));
  setup.dirichlet.resize(1);
  setup.dirichlet[0].displacement = [](const Vec<2>&, double t) { return Vec<2>(0, 0.02 * std::pow(std::sin(3 * t), 4)); };
  setup.time = {.integrator = integrator, .dt = kStep};
  setup.fields.curves = {{.name = "wall", .surfaces = {1}}};
  return setup;
}

/// Its motion in `parts` steps for each of `rows` times.
Motion swing(Integrator integrator, int rows, int parts, bool with_bars) {
  itr::Setup<2> setup = shaken(integrator);
  setup.time.dt /= parts;
  setup.time.steps = rows * parts;
  setup.fields.error_bars = with_bars;
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  Motion motion;
  for (int step = 1; step <= rows * parts; ++step) {
    const StepResult result = simulation.advance();
    EXPECT_TRUE(result.ok) << result.reason;
    if (step % parts != 0) continue;
    simulation.observe([&](const FrameView<2>& frame) {
      const ForceCurvePoint& curve = frame.asked->curves.at(0);
      const PointValue& point = frame.asked->points.at(0);
      motion.points.emplace_back(point.u.data());
      motion.forces.emplace_back(curve.kinds[3].data());
      if (!with_bars) return;
      motion.error_of_points.emplace_back(point.errors.at(kTime).data());
      motion.error_of_forces.emplace_back(curve.errors.at(kTime)[3].data());
    });
  }
  return motion;
}

struct TimeSteps : ::testing::TestWithParam<Integrator> {};
INSTANTIATE_TEST_SUITE_P(ErrorEstimator, TimeSteps,
                         ::testing::Values(Integrator::implicit_euler, Integrator::bdf, Integrator::newmark));

/// Norms of errors and of what estimates are off by, where these are known, and how often they are.
struct Judged {
  double error = 0, off = 0, known = 0;
};
Judged judge(const std::vector<Vec<2>>& exact, const std::vector<Vec<2>>& found, const std::vector<Vec<2>>& estimate) {
  Judged judged;
  for (std::size_t i = 0; i < exact.size(); ++i) {
    if (!estimate[i].allFinite()) continue;
    judged.error += (exact[i] - found[i]).squaredNorm();
    judged.off += (exact[i] - found[i] - estimate[i]).squaredNorm();
    judged.known += 1.0 / static_cast<double>(exact.size());
  }
  return {std::sqrt(judged.error), std::sqrt(judged.off), judged.known};
}

/// Against a twentieth of the step: over one period and over four, in which errors of the steps add up.
TEST_P(TimeSteps, HaveTheErrorThatShorterOnesTakeAway) {
  constexpr double kPart = 0.35;  // of the error, that the estimate may be off by
  for (const int rows : {100, 400}) {
    const Motion steps = swing(GetParam(), rows, 1, true), exact = swing(GetParam(), rows, 20, false);
    const Judged points = judge(exact.points, steps.points, steps.error_of_points);
    const Judged forces = judge(exact.forces, steps.forces, steps.error_of_forces);
    EXPECT_GE(points.known, 0.7) << rows;
    EXPECT_LE(points.off, kPart * points.error) << rows;
    EXPECT_GE(forces.known, 0.3) << rows;
    EXPECT_LE(forces.off, kPart * forces.error) << rows;
  }
}

TEST(ErrorEstimator, KnowsNoErrorInTimeAfterAnImpact) {
  for (const double gap : {1.0, 0.012}) {  // the second one closes
    itr::Setup<2> setup = shaken(Integrator::bdf);
    setup.time.steps = 100;
    setup.obstacles.rest = {{0.12, kSize + gap}, {0.3, kSize + gap}};
    setup.obstacles.edges = {{0, 1}};
    setup.obstacles.motion = {0, 0};
    setup.obstacles.motions = {[](const Vec<2>&, double) { return Vec<2>(0, 0); }};
    setup.contact = {.enabled = true, .dhat = 1e-3, .convergent = true, .barrier_stiffness = 1e4};
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    std::vector<bool> is_known;
    for (int step = 1; step <= setup.time.steps; ++step) {
      const StepResult result = simulation.advance();
      ASSERT_TRUE(result.ok) << result.reason;
      simulation.observe([&](const FrameView<2>& frame) {
        is_known.push_back(std::isfinite(frame.asked->points.at(0).errors.at(kTime)[0]));
      });
    }
    EXPECT_TRUE(is_known.at(setup.time.steps / 4)) << gap;
    EXPECT_EQ(is_known.back(), gap == 1) << gap;
  }
}

TEST(ErrorEstimator, KnowsNoErrorOfIncrementsWithFriction) {
  itr::Setup<2> setup = pressed(4e-4);
  EXPECT_EQ(run(setup).errors.energy[kTime], 0);
  setup.contact.friction_coefficient = 0.3;
  EXPECT_TRUE(std::isnan(run(setup).errors.energy[kTime]));
}

}  // namespace
}  // namespace itr
