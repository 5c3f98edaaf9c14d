// SPDX-License-Identifier: MIT
// Ties: conditions of mortars, bodies bonded with meshes that do not match, refusals.
#include "energy/tie.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "advance.hpp"
#include "block.hpp"
#include "derivatives.hpp"
#include "energy/inertia.hpp"
#include "scene_folder.hpp"
#include "simulation/invariants.hpp"
#include "simulation/resultant.hpp"
#include "simulation/state.hpp"
#include "simulation/step_terms.hpp"
#include "square_mesh.hpp"
#include "tied_bricks.hpp"

namespace itr {
namespace {

template <int Dim>
void expect_rows(const Mesh<Dim>& mesh) {
  const CellSet<Dim> cells = whole_mesh(mesh, {});
  const Tie tie{{kOfA}, {kOfB}};
  const auto is_held = [&](int node, int c) { return c == 0 && mesh.rest(node)[0] == 0; };
  const auto mortars = make_mortars<Dim>(cells, std::span(&tie, 1), is_held);
  ASSERT_EQ(mortars.size(), 1u);
  EXPECT_NEAR(mortars[0].covered, 1, 1e-12);
  std::array<double, Dim> total{};
  for (const auto& row : mortars[0].rows) {
    double sum = 0;
    for (const double weight : row.weights) sum += weight;
    EXPECT_NEAR(sum, 0, 1e-15);
    EXPECT_FALSE(row.components[0] && mesh.rest(row.vertex)[0] == 0);
    for (int c = 0; c < Dim; ++c)
      if (row.components[c]) total[c] += row.measure;
  }
  for (const double area : total) EXPECT_NEAR(area, cells.axisymmetric ? std::numbers::pi : 1, 1e-12);
  std::map<int, Material> materials{{1, {}}, {2, {}}};
  TieEnergy<Dim> energy(cells, mortars, materials, true, 0.1);
  std::mt19937 random(1);
  std::normal_distribution<double> normal(0, 0.1);
  const VectorX rest = rest_positions<Dim>(cells);
  const VectorX x = rest + VectorX::NullaryExpr(rest.size(), [&] { return normal(random); });
  energy.begin_at(rest);
  energy.update({rest, x - rest});
  expect_derivatives(energy, x, 1e-4, 1e-7);
  expect_psd(energy, x);
  VectorX turned = rest;  // an affine motion has no gaps
  Mat<Dim> F = Mat<Dim>::Random();
  for (Eigen::Index i = 0; i < rest.size(); i += Dim) turned.segment<Dim>(i) = F * rest.segment<Dim>(i);
  EXPECT_LE(energy.largest_gap(VectorX(turned - rest)), 1e-13);
}

TEST(Tie, RowsAreMeansAndTheirEnergyHasItsDerivatives) {
  expect_rows(two_cubes<2>(3, 4));
  expect_rows(two_cubes<3>(2, 3));
  expect_rows(two_cubes<3>(3, 2, 0.02));
  Mesh<2> turned = two_cubes<2>(3, 2);
  turned.set_axisymmetric(true);
  expect_rows(turned);
  Mesh<2> curved = two_cubes<2>(3, 2, 0.02);
  curved.set_curved_edges(curved.edges());
  expect_rows(curved);
}

template <int Dim>
void expect_patch_test(Mesh<Dim> mesh, int order) {
  Setup<Dim> setup = tied<Dim>(std::move(mesh));
  setup.order = {{1, order}, {2, order}};
  put_on_rollers(setup);
  pull(setup, 2e4);
  ask_for_forces(setup);
  linear::Registry registry;
  Simulation<Dim> simulation(setup, registry);
  advance(simulation);
  EXPECT_LE(spread_of_strain(simulation), 1e-9);
  EXPECT_LE(largest_gap(simulation), 1e-10);
  const double area = setup.mesh.is_axisymmetric() ? std::numbers::pi : 1;
  const auto forces = [&](const ForceTarget& target) { return force_sums(simulation.state(), simulation.forces(), target); };
  EXPECT_NEAR(forces({.name = "a", .surfaces = {kOfA}}).contact.force[Dim - 1], 2e4 * area, 1e-5);
  EXPECT_NEAR(forces({.name = "b", .surfaces = {kOfB}}).contact.force[Dim - 1], -2e4 * area, 1e-5);
  const auto both = forces({.name = "bodies", .bodies = {1, 2}});
  EXPECT_LE(both.contact.force.norm(), 1e-10 * 2e4);
  EXPECT_LE(both.contact.moment.norm(), 1e-10 * 2e4);
}

TEST(Tie, UniformStressPassesMeshesThatDoNotMatch) {
  expect_patch_test(two_cubes<2>(3, 4), 1);
  expect_patch_test(two_cubes<2>(5, 2), 2);
  expect_patch_test(two_cubes<3>(2, 3), 1);
  Mesh<2> turned = two_cubes<2>(3, 2);
  turned.set_axisymmetric(true);
  expect_patch_test(turned, 1);
}

TEST(Tie, BeamOfTwoLayersBendsAsOne) {
  constexpr double kLength = 10, kHeight = 1, kShear = 100;
  Plane setup =
      tied<2>(two_bricks<2>({{30, 2}, {0, 0}, {kLength, kHeight / 2}}, {{41, 3}, {0, kHeight / 2}, {kLength, kHeight}}));
  for (const FacetId f : setup.mesh.live_facets()) {
    const auto& facet = setup.mesh.facet(f);
    if (setup.mesh.rest(facet[0])[0] > kLength - 1e-9 && setup.mesh.rest(facet[1])[0] > kLength - 1e-9)
      setup.mesh.set_facet_tag(f, kAbove + 10);
  }
  for (auto& [body, material] : setup.materials) material.law = MaterialLaw::linear;
  setup.order = {{1, 2}, {2, 2}};
  setup.dirichlet.push_back({kLeft, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }});
  setup.neumann.push_back({kAbove + 10, [](const Vec<2>&, double) { return Vec<2>(0, -kShear); }});
  ask_for_forces(setup);
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  advance(simulation);
  double tip = 0;
  const auto& state = simulation.state();
  for (int v = 0; v < state.mesh.num_vertices(); ++v)
    if (state.mesh.rest(v)[0] > kLength - 1e-9) tip = std::min(tip, state.history.x[0][2 * v + 1] - state.mesh.rest(v)[1]);
  const double E = 1e5, force = kShear * kHeight, inertia = std::pow(kHeight, 3) / 12;
  const double of_bending = force * std::pow(kLength, 3) / (3 * E * inertia),
               of_shear = 1.2 * force * kLength * 2.6 / (E * kHeight);
  EXPECT_NEAR(-tip / (of_bending + of_shear), 1, 3e-3);  // a wall that holds the width, too, is a little stiffer
  EXPECT_LE(largest_gap(simulation), 1e-9);
}

template <int Dim>
void expect_momentum(Integrator integrator) {
  Setup<Dim> setup = tied<Dim>(two_cubes<Dim>(2, 3, 0.01));
  setup.time = {.integrator = integrator, .dt = 0.02, .steps = 20};
  setup.materials[2].youngs_modulus = 5e5;
  for (const int body : {1, 2})
    setup.initial_velocity.push_back({body, [](const Vec<Dim>& X, double) {
                                        Vec<Dim> v = Vec<Dim>::Zero();
                                        v[0] = 1 - 2 * X[1], v[1] = 0.5 + 2 * X[0];
                                        return v;
                                      }});
  linear::Registry registry;
  Simulation<Dim> simulation(setup, registry);
  const auto momentum = [&] {
    const CellSet<Dim> cells = whole_mesh(simulation.mesh(), {});
    const VectorX& v = simulation.state().history.v[0];
    VectorX product = VectorX::Zero(v.size());
    InertiaEnergy<Dim>(cells, setup.materials, MassKind::consistent, VectorX::Zero(v.size())).add_mass_product(v, product);
    return product;
  };
  const auto angular = [&](const VectorX& product) {
    double sum = 0;
    const VectorX& x = simulation.state().history.x[0];
    for (Eigen::Index i = 0; i < x.size(); i += Dim) sum += x[i] * product[i + 1] - x[i + 1] * product[i];
    return sum;
  };
  const VectorX start = momentum();
  const double angular_start = angular(start);
  for (int step = 0; step < setup.time.steps; ++step) advance(simulation);
  const VectorX end = momentum();
  EXPECT_LE((sum<Dim>(end) - sum<Dim>(start)).norm(), 1e-9 * sum<Dim>(start).norm());
  if (integrator == Integrator::newmark) {
    EXPECT_NEAR(angular(end) / angular_start, 1, 0.01);
  }
  EXPECT_LE(largest_gap(simulation), 1e-9);
}

TEST(Tie, KeepsMomentum) {
  expect_momentum<2>(Integrator::newmark);
  expect_momentum<2>(Integrator::implicit_euler);
  expect_momentum<3>(Integrator::newmark);
}

/// The forces of a tie have no moment about any point: with zero gaps.
TEST(Tie, ForcesHaveNoMoment) {
  Plane setup = tied<2>(two_cubes<2>(3, 4, 0.02));
  setup.dirichlet.push_back({kBelow, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }});
  setup.neumann.push_back({kAbove, [](const Vec<2>& X, double) { return Vec<2>(2e4, 1e4 * X[0]); }});
  ask_for_forces(setup);
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  advance(simulation);
  const ForceTarget both{.name = "bodies", .bodies = {1, 2}, .about = {3, -2, 0}}, upper{.name = "upper", .bodies = {2}};
  const auto sums = force_sums(simulation.state(), simulation.forces(), both);
  EXPECT_LE(sums.contact.force.norm(), 1e-10 * 2e4);
  EXPECT_LE(std::abs(sums.contact.moment[0]), 1e-9 * 2e4);
  const auto of_upper = force_sums(simulation.state(), simulation.forces(), upper);
  EXPECT_LE((of_upper.all.force + of_upper.body.force + of_upper.residual.force).norm(), 1e-6);
  EXPECT_NEAR(of_upper.contact.force[0], -2e4, 1e-4);
}

template <int Dim>
Setup<Dim> falling() {
  Brick<Dim> a, b;
  a.boxes.fill(Dim == 2 ? 3 : 2);
  b.boxes.fill(Dim == 2 ? 2 : 1);
  a.least = Vec<Dim>::Zero();
  a.most = b.most = Vec<Dim>::Ones();
  b.least = Vec<Dim>::Unit(Dim - 1) + 0.25 * Vec<Dim>::Unit(0);
  b.most[Dim - 1] = 1.6;
  b.most[0] = 0.77;
  Setup<Dim> setup = tied<Dim>(two_bricks(a, b));
  auto& floor = setup.obstacles;
  if constexpr (Dim == 2) {
    floor.rest = {{-9, -0.01}, {9, -0.01}};
    floor.edges = {{0, 1}};
  } else {
    floor.rest = {{-9, -9, -0.01}, {9, -9, -0.01}, {0, 9, -0.01}};
    floor.triangles = {{0, 1, 2}};
  }
  floor.motion.assign(floor.rest.size(), kNone);
  setup.contact = {.enabled = true, .dhat = 0, .convergent = true, .friction_coefficient = 0.2};
  setup.contact.friction_velocity = 0;
  setup.body_acceleration = [](const Vec<Dim>&, double) { return Vec<Dim>(-10 * Vec<Dim>::Unit(Dim - 1)); };
  setup.time = {.dt = 0.02, .steps = 10};
  return setup;
}

template <int Dim>
void expect_contact_elsewhere() {
  linear::Registry registry;
  Simulation<Dim> simulation(falling<Dim>(), registry), again(falling<Dim>(), registry);
  double pressed = 0;
  Snapshot<Dim> middle;
  constexpr int kSteps = 6;
  for (int step = 0; step < kSteps; ++step) {
    if (step == kSteps / 2) middle = simulation.save();
    const StepResult result = advance(simulation);
    pressed = std::max(pressed, result.report.energy.contact);
    const auto& state = simulation.state();
    EXPECT_EQ(find_violation(simulation.setup(), state.mesh, state.history.x[0], state.chords, 0), "");
  }
  EXPECT_GT(pressed, 0);
  EXPECT_LE(largest_gap(simulation), 1e-9);
  again.restore(*middle.state);
  for (int step = kSteps / 2; step < kSteps; ++step) advance(again);
  EXPECT_EQ(again.state().history.x[0], simulation.state().history.x[0]);
}

TEST(Tie, IsNoContactAndLeavesContactElsewhere) {
  expect_contact_elsewhere<2>();
  expect_contact_elsewhere<3>();
}

/// A third brick falls on tied ones that it touches at rest: it may not sink in by more than d-hat, though ties may.
TEST(Tie, LetsOtherClosedFacesReachAsFarAsWithout) {
  std::vector<Vec<2>> rest;
  std::vector<std::array<int, 3>> cells;
  std::vector<int> bodies;
  for (int body = 1; body <= 3; ++body)
    add<2>({{2, 2}, {0, body - 1.0}, {1, static_cast<double>(body)}}, body, rest, cells, bodies);
  Mesh<2> mesh(rest, cells, bodies);
  for (const FacetId f : mesh.live_facets()) {
    const Vec<2> middle = (mesh.rest(mesh.facet(f)[0]) + mesh.rest(mesh.facet(f)[1])) / 2;
    const int body = mesh.body(mesh.cells_of(mesh.facet(f)[0])[0]);
    if (middle[1] == 0) mesh.set_facet_tag(f, kBelow);
    if (middle[1] == 1) mesh.set_facet_tag(f, body == 1 ? kOfA : kOfB);
  }
  Plane setup = tied<2>(std::move(mesh));
  setup.materials[3] = setup.materials[1];
  setup.dirichlet.push_back({kBelow, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }});
  setup.body_acceleration = [](const Vec<2>& X, double) { return Vec<2>(0, X[1] > 2 ? -10 : 0); };
  setup.contact = {.enabled = true, .dhat = 0, .convergent = true};
  setup.time = {.dt = 0.02, .steps = 1};
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  ASSERT_GT(simulation.setup().contact.tie_reach, 0.1);
  const StepResult result = simulation.advance();
  EXPECT_FALSE(result.ok);
  EXPECT_NE(result.reason.find("pressed into each other"), std::string::npos) << result.reason;
}

TEST(Tie, StaysWhereSidesAreRemeshed) {
  for (const bool is_dynamic : {false, true}) {
    Plane setup = tied<2>(two_cubes<2>(2, 3));
    setup.dirichlet.push_back({kBelow, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }});
    setup.neumann.push_back({kAbove, [](const Vec<2>&, double t) { return Vec<2>(2e4 * std::min(t, 1.0), 0); }});
    setup.time = {.quasistatic = !is_dynamic, .dt = 0.25, .steps = 3};
    setup.contact = {.enabled = true, .dhat = 0, .convergent = true};
    setup.remesh.enabled = true;
    setup.remesh.relative_tolerance = 1e-5;
    ask_for_forces(setup);
    linear::Registry registry;
    std::string warnings;  // closed faces have none where a bond presses them into each other
    Simulation<2> simulation(setup, registry, Logger([&](LogLevel level, std::string_view message) {
                               if (level == LogLevel::warning) warnings.append(message).append("\n");
                             }));
    const auto facets_of_ties = [](const Mesh<2>& mesh) {
      return std::ranges::count_if(mesh.live_facets(), [&](FacetId f) { return mesh.facet_tag(f) >= kOfA; });
    };
    for (int step = 0; step < setup.time.steps; ++step) {
      advance(simulation);
      EXPECT_LE(largest_gap(simulation), 1e-9);
      const auto sums = force_sums(simulation.state(), simulation.forces(), {.name = "bodies", .bodies = {1, 2}});
      EXPECT_LE(sums.contact.force.norm(), 1e-10 * 2e4);
    }
    EXPECT_EQ(warnings, "");
    EXPECT_GT(simulation.mesh().num_vertices(), setup.mesh.num_vertices());
    if (is_dynamic)
      EXPECT_EQ(facets_of_ties(simulation.mesh()), facets_of_ties(setup.mesh));
    else
      EXPECT_GT(facets_of_ties(simulation.mesh()), facets_of_ties(setup.mesh));
  }
}

TEST(Tie, RefusesSurfacesThatDoNotMeet) {
  Plane apart = tied<2>(two_cubes<2>(2, 3, 0.2));
  EXPECT_EQ(refusal_of(apart), "/ties/0: surfaces that are 0.2 m apart, or do not face each other");
  Plane beside = tied<2>(two_bricks<2>({{2, 2}, {0, 0}, {1, 1}}, {{2, 2}, {0.5, 1}, {2, 2}}));
  EXPECT_EQ(refusal_of(beside), "/ties/0: surfaces of which neither covers the other: at most 50.0 % of one side");
  Plane moving = tied<2>(two_cubes<2>(2, 3));
  moving.time = {.dt = 0.1, .steps = 1};
  moving.initial_velocity.push_back({1, [](const Vec<2>&, double) { return Vec<2>(1, 0); }});
  EXPECT_EQ(refusal_of(moving).substr(0, 28), "/initial_conditions/velocity");
  Plane unknown = tied<2>(two_cubes<2>(2, 3));
  unknown.ties[0].b = {77};
  EXPECT_EQ(refusal_of(unknown), "/ties/0/b: 77, which no surface has");
}

TEST(Tie, FailsWhereConditionsTearIt) {
  Plane setup = tied<2>(two_cubes<2>(2, 3));
  setup.dirichlet.push_back({kOfA, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }});
  setup.dirichlet.push_back({kOfB, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0.1); }});
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const StepResult result = simulation.advance();
  EXPECT_FALSE(result.ok);
  EXPECT_NE(result.reason.find("tied surfaces stay apart"), std::string::npos) << result.reason;
}

}  // namespace
}  // namespace itr

namespace itr::scene {
namespace {

class TieSceneTest : public SceneTest {
 protected:
  TieSceneTest() { write("low.obj", "v 0 -1 0\nv 1 -1 0\nv 1 0 0\nv 0 0 0\nf 1 2 3\nf 1 3 4\n"); }
  json scene(const json& ties) const {
    return square({{"geometry",
                    {{{"mesh", "low.obj"},
                      {"volume_selection", 1},
                      {"surface_selection", {{{"id", 3}, {"axis", "y"}, {"position", -1e-9}}}}},
                     {{"mesh", "square.obj"},
                      {"volume_selection", 1},
                      {"surface_selection", {{{"id", 4}, {"axis", "-y"}, {"position", 1e-9}}}}}}},
                   {"ties", ties}});
  }
};

TEST_F(TieSceneTest, ReadsSidesByTheirIds) {
  const itr::Setup<2> setup = read2(scene({{{"a", 3}, {"b", 4}}}));
  ASSERT_EQ(setup.ties.size(), 1u);
  EXPECT_EQ(setup.ties[0].a, std::vector<int>{3});
  EXPECT_EQ(setup.ties[0].b, std::vector<int>{4});
  EXPECT_FALSE(setup.ties[0].jump);
  const itr::Setup<2> cell = read2(scene({{{"a", 3}, {"b", 4}, {"periodic", true}, {"jump", {0, "2*t"}}}}));
  EXPECT_EQ(cell.ties[0].jump(3), Vec<3>(0, 6, 0));
}

TEST_F(TieSceneTest, RefusesByKey) {
  EXPECT_EQ(failure(scene({{{"a", 3}, {"b", 9}}})).place, "/ties/0/b");
  EXPECT_EQ(failure(scene({{{"a", 3}, {"b", 3}}})).place, "/ties/0/b");
  EXPECT_EQ(failure(scene({{{"a", 3}}})).place, "/ties/0/b");
  EXPECT_EQ(failure(scene({{{"a", 3}, {"b", 4}, {"c", 5}}})).place, "/ties/0/c");
  EXPECT_EQ(failure(scene({{{"a", 3}, {"b", 4}, {"jump", {0, 1}}}})).place, "/ties/0/jump");
  EXPECT_EQ(failure(scene({{{"a", 3}, {"b", 4}, {"periodic", true}, {"jump", {1}}}})).place, "/ties/0/jump");
}

}  // namespace
}  // namespace itr::scene
