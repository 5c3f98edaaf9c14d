// SPDX-License-Identifier: MIT
// Ties: conditions of mortars, bodies bonded with meshes that do not match, what is refused.
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

namespace itr {
namespace {

using Plane = Setup<2>;

constexpr int kBelow = 1, kLeft = 2, kFront = 3, kFree = 4, kAbove = 5, kOfA = 6, kOfB = 7;  ///< tags

/// Boxes of a grid over a brick, with simplices around their diagonals.
template <int Dim>
struct Brick {
  std::array<int, Dim> boxes;
  Vec<Dim> least, most;
};

template <int Dim>
void add(const Brick<Dim>& brick, int body, std::vector<Vec<Dim>>& rest, std::vector<std::array<int, Dim + 1>>& cells,
         std::vector<int>& bodies) {
  const int first = static_cast<int>(rest.size());
  std::array<int, Dim> stride;
  int points = 1, boxes = 1;
  for (int c = 0; c < Dim; ++c) {
    stride[c] = points;
    points *= brick.boxes[c] + 1;
    boxes *= brick.boxes[c];
  }
  for (int p = 0; p < points; ++p) {
    Vec<Dim> X;
    for (int c = 0; c < Dim; ++c) {
      const double part = static_cast<double>(p / stride[c] % (brick.boxes[c] + 1)) / brick.boxes[c];
      X[c] = brick.least[c] + part * (brick.most[c] - brick.least[c]);
    }
    rest.push_back(X);
  }
  for (int b = 0; b < boxes; ++b) {
    int corner = first, left = b;
    for (int c = 0; c < Dim; ++c) {
      corner += left % brick.boxes[c] * stride[c];
      left /= brick.boxes[c];
    }
    const auto at = [&](int i) {
      int v = corner;
      for (int c = 0; c < Dim; ++c) v += (i >> c & 1) * stride[c];
      return v;
    };
    if constexpr (Dim == 2) {
      cells.push_back({at(0), at(1), at(3)});
      cells.push_back({at(0), at(3), at(2)});
    } else {
      for (const auto& [i, j] : {std::pair{1, 3}, {3, 2}, {2, 6}, {6, 4}, {4, 5}, {5, 1}})
        cells.push_back({at(0), at(i), at(j), at(7)});
    }
    bodies.resize(cells.size(), body);
  }
}

/// Body 1 below the plane at `height` of the last axis, body 2 above it. Both begin at the origin.
template <int Dim>
Mesh<Dim> two_bricks(const Brick<Dim>& a, const Brick<Dim>& b) {
  std::vector<Vec<Dim>> rest;
  std::vector<std::array<int, Dim + 1>> cells;
  std::vector<int> bodies;
  add(a, 1, rest, cells, bodies);
  add(b, 2, rest, cells, bodies);
  Mesh<Dim> mesh(rest, cells, bodies);
  for (const FacetId f : mesh.live_facets()) {
    const auto is_at = [&](int c, double value) {
      return std::ranges::all_of(mesh.facet(f), [&](VertexId v) { return std::abs(mesh.rest(v)[c] - value) < 1e-9; });
    };
    const bool is_of_a = mesh.body(mesh.cells_of(mesh.facet(f)[0])[0]) == 1;
    int tag = kFree;
    if (is_at(0, 0)) tag = kLeft;
    if (Dim == 3 && is_at(1, 0)) tag = kFront;
    if (is_at(Dim - 1, a.least[Dim - 1])) tag = kBelow;
    if (is_at(Dim - 1, b.most[Dim - 1])) tag = kAbove;
    if (is_of_a && is_at(Dim - 1, a.most[Dim - 1])) tag = kOfA;
    if (!is_of_a && is_at(Dim - 1, b.least[Dim - 1])) tag = kOfB;
    mesh.set_facet_tag(f, tag);
  }
  return mesh;
}

template <int Dim>
Mesh<Dim> two_cubes(int n, int m, double gap = 0) {
  Brick<Dim> a, b;
  a.boxes.fill(n);
  b.boxes.fill(m);
  a.least = Vec<Dim>::Zero();
  a.most = b.most = Vec<Dim>::Ones();
  b.least = (1 + gap) * Vec<Dim>::Unit(Dim - 1);
  b.most[Dim - 1] = 2 + gap;
  return two_bricks(a, b);
}

template <int Dim>
Setup<Dim> tied(Mesh<Dim> mesh) {
  Setup<Dim> setup;
  setup.mesh = std::move(mesh);
  for (const int body : {1, 2}) setup.materials[body] = {.youngs_modulus = 1e5, .poisson_ratio = 0.3, .density = 1000};
  setup.ties = {{{kOfA}, {kOfB}}};
  setup.time = {.is_static = true};
  return setup;
}

/// Rollers below and at the sides.
template <int Dim>
void put_on_rollers(Setup<Dim>& setup) {
  const auto hold = [&](int tag, int c) {
    DirichletCondition<Dim> condition{tag, {}, [](const Vec<Dim>&, double) { return Vec<Dim>(Vec<Dim>::Zero()); }};
    condition.components[c] = true;
    setup.dirichlet.push_back(condition);
  };
  hold(kBelow, Dim - 1);
  hold(kLeft, 0);
  if (Dim == 3) hold(kFront, 1);
  // The rollers of an edge belong to the largest tag there: those of the sides hold the bottom, too.
}

template <int Dim>
void pull(Setup<Dim>& setup, double traction) {
  setup.neumann.push_back({kAbove, [=](const Vec<Dim>&, double) { return Vec<Dim>(traction * Vec<Dim>::Unit(Dim - 1)); }});
}

template <int Dim>
void ask_for_forces(Setup<Dim>& setup) {
  setup.fields = {true, true, true, true, true, true, true};
  setup.fields.applied_forces = true;
  setup.fields.curves = {{.name = "a", .surfaces = {kOfA}},
                         {.name = "b", .surfaces = {kOfB}},
                         {.name = "bodies", .bodies = {1, 2}},
                         {.name = "upper", .bodies = {2}}};
}

/// The largest entry by which deformation gradients differ from that of the first cell, less 1 itself.
template <int Dim>
double spread_of_strain(const Simulation<Dim>& simulation) {
  const auto& state = simulation.state();
  const CellSet<Dim> cells = whole_mesh(state.mesh, {});
  const Mat<Dim> first = deformation_gradient<Dim>(cells.elements[0], state.history.x[0]);
  double largest = 0;
  for (const auto& element : cells.elements)
    largest = std::max(largest, (deformation_gradient<Dim>(element, state.history.x[0]) - first).cwiseAbs().maxCoeff());
  return largest / (first - Mat<Dim>::Identity()).norm();
}

template <int Dim>
double largest_gap(const Simulation<Dim>& simulation) {
  const auto& state = simulation.state();
  const CellSet<Dim> cells = whole_mesh(state.mesh, simulation.setup().obstacles.rest);
  const auto mortars = mortars_of<Dim>(simulation.setup(), state.mesh, cells);
  const TieEnergy<Dim> tie(cells, mortars, simulation.setup().materials, false, 1);
  return tie.largest_gap(VectorX(state.history.x[0] - rest_positions<Dim>(cells)));
}

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
  const auto place_of = [](const Plane& setup) {
    linear::Registry registry;
    try {
      Simulation<2> simulation(setup, registry);
    } catch (const InputError& error) {
      return error.parts().place + ": " + error.parts().found;
    }
    return std::string();
  };
  Plane apart = tied<2>(two_cubes<2>(2, 3, 0.2));
  EXPECT_EQ(place_of(apart), "/ties/0: surfaces that are 0.2 m apart, or do not face each other");
  Plane beside = tied<2>(two_bricks<2>({{2, 2}, {0, 0}, {1, 1}}, {{2, 2}, {0.5, 1}, {2, 2}}));
  EXPECT_EQ(place_of(beside), "/ties/0: surfaces of which neither covers the other: at most 50.0 % of one side");
  Plane moving = tied<2>(two_cubes<2>(2, 3));
  moving.time = {.dt = 0.1, .steps = 1};
  moving.initial_velocity.push_back({1, [](const Vec<2>&, double) { return Vec<2>(1, 0); }});
  EXPECT_EQ(place_of(moving).substr(0, 28), "/initial_conditions/velocity");
  Plane unknown = tied<2>(two_cubes<2>(2, 3));
  unknown.ties[0].b = {77};
  EXPECT_EQ(place_of(unknown), "/ties/0/b: 77, which no surface has");
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

constexpr int kRight = 12, kBack = 13, kPoint = 14;

/// A periodic cell of two layers of 1 by 1 (by 1), of which one vertex is held: under a macroscopic displacement gradient.
template <int Dim>
Setup<Dim> periodic_cell(const Mat<Dim>& gradient, int below, int above) {
  Setup<Dim> setup = tied<Dim>(two_cubes<Dim>(below, above));
  Mesh<Dim>& mesh = setup.mesh;
  for (const FacetId f : mesh.live_facets()) {
    const auto is_at = [&](int c) {
      return std::ranges::all_of(mesh.facet(f), [&](VertexId v) { return mesh.rest(v)[c] > 1 - 1e-9; });
    };
    if (is_at(0)) mesh.set_facet_tag(f, kRight);
    if (Dim == 3 && is_at(1)) mesh.set_facet_tag(f, kBack);
  }
  mesh.set_vertex_tag(0, kPoint);
  std::array<bool, Dim> all;
  all.fill(true);
  setup.dirichlet.push_back({kPoint, all, [](const Vec<Dim>&, double) { return Vec<Dim>(Vec<Dim>::Zero()); }});
  const auto tie = [&](int a, int b, const Vec<Dim>& period) {
    Vec<3> jump = Vec<3>::Zero();
    jump.head<Dim>() = gradient * period;
    setup.ties.push_back({{a}, {b}, [jump](double) { return jump; }});
  };
  tie(kRight, kLeft, -Vec<Dim>::Unit(0));
  if (Dim == 3) tie(kFront, kBack, Vec<Dim>::Unit(1));
  tie(kBelow, kAbove, 2 * Vec<Dim>::Unit(Dim - 1));
  return setup;
}

template <int Dim>
void expect_uniform_cell(int below, int above, int order) {
  Mat<Dim> gradient = 0.1 * Mat<Dim>::Identity();
  gradient(0, Dim - 1) = 0.2;
  gradient(Dim - 1, 0) = -0.05;
  Setup<Dim> setup = periodic_cell<Dim>(gradient, below, above);
  setup.order = {{1, order}, {2, order}};
  linear::Registry registry;
  Simulation<Dim> simulation(setup, registry);
  advance(simulation);
  EXPECT_LE(spread_of_strain(simulation), 1e-8);
  const CellSet<Dim> cells = whole_mesh(simulation.mesh(), {});
  const Mat<Dim> F = deformation_gradient<Dim>(cells.elements[0], simulation.state().history.x[0]);
  EXPECT_LE((F - Mat<Dim>::Identity() - gradient).norm(), 1e-8);
}

TEST(Tie, PeriodicCellsOfOneMaterialHaveTheMacroscopicGradient) {
  expect_uniform_cell<2>(3, 3, 1);
  expect_uniform_cell<2>(3, 4, 1);
  expect_uniform_cell<2>(4, 3, 2);
  expect_uniform_cell<3>(2, 3, 1);
}

TEST(Tie, PeriodicCellsFailWhereConditionsHoldAnotherJump) {
  Mat<2> gradient = Mat<2>::Zero();
  gradient(0, 0) = 0.1;
  Plane setup = periodic_cell<2>(gradient, 2, 2);
  for (const int tag : {kRight, kLeft})
    setup.dirichlet.push_back({tag, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }});
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const StepResult result = simulation.advance();
  EXPECT_FALSE(result.ok);
  EXPECT_NE(result.reason.find("stay apart by 0.1 m"), std::string::npos) << result.reason;
}

/// The traction on the right or the upper side of a laminate.
Vec<2> traction_of_laminate(const Mat<2>& gradient, bool is_right) {
  Plane setup = periodic_cell<2>(gradient, 3, 4);
  setup.materials[2].youngs_modulus = 4e5;
  for (auto& [body, material] : setup.materials) material.law = MaterialLaw::linear, material.poisson_ratio = 0;
  ask_for_forces(setup);
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  advance(simulation);
  EXPECT_LE(simulation.state().history.x[0].head(2).norm(), 1e-12);
  const auto sums =
      force_sums(simulation.state(), simulation.forces(), {.name = "", .surfaces = {is_right ? kRight : kAbove}});
  return sums.contact.force.head<2>() / (is_right ? 2 : 1);
}

TEST(Tie, PeriodicLaminatesHaveTheirEffectiveModuli) {
  constexpr double kStrain = 1e-3, kFirst = 1e5, kSecond = 4e5;
  const double mean = (kFirst + kSecond) / 2, harmonic = 2 / (1 / kFirst + 1 / kSecond);
  Mat<2> along = Mat<2>::Zero(), across = along, shear = along;
  along(0, 0) = across(1, 1) = shear(0, 1) = kStrain;
  EXPECT_NEAR(traction_of_laminate(along, true)[0], mean * kStrain, 1e-6 * mean * kStrain);
  EXPECT_NEAR(traction_of_laminate(across, false)[1], harmonic * kStrain, 1e-6 * mean * kStrain);
  EXPECT_NEAR(traction_of_laminate(shear, false)[0], harmonic / 2 * kStrain, 1e-6 * mean * kStrain);
}

TEST(Tie, PeriodicSidesHaveOneShape) {
  const auto found = [](const Plane& setup) {
    linear::Registry registry;
    try {
      Simulation<2> simulation(setup, registry);
    } catch (const InputError& error) {
      return error.parts().place + ": " + error.parts().found;
    }
    return std::string();
  };
  Plane setup = periodic_cell<2>(Mat<2>::Zero(), 2, 3);
  bool is_cut = false;
  for (const FacetId f : setup.mesh.live_facets())
    if (setup.mesh.facet_tag(f) == kRight && !std::exchange(is_cut, true)) setup.mesh.set_facet_tag(f, kFree);
  EXPECT_EQ(found(setup).substr(0, 16), "/ties/1/periodic");
  setup = periodic_cell<2>(Mat<2>::Zero(), 2, 3);
  setup.time = {.dt = 0.1, .steps = 1};
  EXPECT_EQ(found(setup), "/ties: periodic cells with inertia");
}

TEST(Tie, PeriodicCellsAreRemeshed) {
  Mat<2> gradient = Mat<2>::Zero();
  gradient(0, 1) = 0.3;
  Plane setup = periodic_cell<2>(gradient, 2, 2);
  setup.materials[2].youngs_modulus = 1e6;
  for (const FacetId f : setup.mesh.live_facets())  // only half of the layers is bonded, so that stresses differ
    if (setup.mesh.facet_tag(f) == kOfA &&
        setup.mesh.rest(setup.mesh.facet(f)[0])[0] + setup.mesh.rest(setup.mesh.facet(f)[1])[0] > 1)
      setup.mesh.set_facet_tag(f, kFree);
  setup.time = {.quasistatic = true, .dt = 1, .steps = 1};
  setup.remesh.enabled = true;
  setup.remesh.relative_tolerance = 1e-4;
  setup.remesh.curve.enabled = false;
  ask_for_forces(setup);
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  advance(simulation);
  EXPECT_GT(simulation.mesh().num_vertices(), setup.mesh.num_vertices());
  const auto force = [&](const ForceTarget& target) {
    return Vec<2>(force_sums(simulation.state(), simulation.forces(), target).contact.force.head<2>());
  };
  const double shear = force({.name = "", .surfaces = {kAbove}})[0];
  EXPECT_GT(shear, 0);
  EXPECT_LE(force({.name = "", .bodies = {1, 2}}).norm(), 1e-10 * shear);
  const Mesh<2>& mesh = simulation.mesh();
  const auto displacement = [&](int tag) {  // the mean over the surface
    Vec<2> sum = Vec<2>::Zero();
    for (const FacetId f : mesh.live_facets()) {
      if (mesh.facet_tag(f) != tag) continue;
      const auto& [a, b] = mesh.facet(f);
      for (const VertexId v : {a, b})
        sum += (mesh.rest(a) - mesh.rest(b)).norm() / 2 * (vertex_of<2>(simulation.state().history.x[0], v) - mesh.rest(v));
    }
    return sum;
  };
  EXPECT_LE((displacement(kAbove) - displacement(kBelow) - gradient * Vec<2>(0, 2)).norm(), 1e-8);
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
