// SPDX-License-Identifier: MIT
// Runs of bodies of revolution against closed forms, with remeshing, and what scenes say of them.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "advance.hpp"
#include "block.hpp"
#include "energy/inertia.hpp"
#include "itr/simulation.hpp"
#include "scene_folder.hpp"
#include "simulation/state.hpp"
#include "square_mesh.hpp"
#include "sums_of_laws.hpp"

namespace itr {
namespace {

constexpr double kPi = std::numbers::pi;
using Scene = Setup<2>;

template <typename Place>
Mesh<2> mapped(int n, const Place& place) {
  const Grid grid = make_grid(
      n, [&](int i, int j) { return place(double(i) / n, double(j) / n); }, [](int i, int j) { return (i + j) % 2; });
  Mesh<2> mesh(grid.rest, grid.cells, std::vector<int>(grid.cells.size(), 1));
  mesh.set_axisymmetric(true);
  return mesh;
}

Scene static_setup(Mesh<2> mesh, int order) {
  Scene setup;
  setup.mesh = std::move(mesh);
  setup.order = {{1, order}};
  setup.materials[1] = {.law = MaterialLaw::linear, .youngs_modulus = 1e4, .poisson_ratio = 0.3, .density = 1000};
  setup.time = {.is_static = true};
  return setup;
}

double largest_error(const Scene& setup, const std::function<Vec<2>(const Vec<2>&)>& exact) {
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  advance(simulation);
  const auto& state = simulation.state();
  double largest = 0, size = 0;
  for (int v = 0; v < state.mesh.num_nodes(); ++v) {
    const Vec<2> X = state.mesh.point_of_node(v), u = state.history.x[0].segment<2>(2 * v) - X;
    largest = std::max(largest, (u - exact(X)).norm());
    size = std::max(size, u.norm());
  }
  return largest / size;
}

/// Lame's tube between plates: radii 1 and 2, pressure inside.
TEST(Axisymmetry, TubeUnderPressureIsLames) {
  const double p = 1, E = 1e4, nu = 0.3, C = p / 3, D = 4 * p / 3;
  const auto exact = [&](const Vec<2>& X) { return Vec<2>((1 + nu) / E * ((1 - 2 * nu) * C * X[0] + D / X[0]), 0); };
  for (const int order : {1, 2}) {
    std::vector<double> errors;
    for (const int n : {4, 8, 16}) {
      Mesh<2> mesh = mapped(n, [](double a, double b) { return Vec<2>(1 + a, b); });
      for (const FacetId f : mesh.live_facets()) {
        const Vec<2> X = (mesh.rest(mesh.facet(f)[0]) + mesh.rest(mesh.facet(f)[1])) / 2;
        mesh.set_facet_tag(f, X[0] == 1 ? 1 : X[0] == 2 ? 2 : 3);
      }
      Scene setup = static_setup(mesh, order);
      setup.dirichlet.push_back({3, {false, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }});
      setup.neumann.push_back({1, [&](const Vec<2>&, double) { return Vec<2>(p, 0); }});
      errors.push_back(largest_error(setup, exact));
    }
    SCOPED_TRACE(order);
    RecordProperty("errors of order " + std::to_string(order), ::testing::PrintToString(errors));
    EXPECT_LT(errors[2], order == 1 ? 5e-3 : 2e-5);
    EXPECT_GT(errors[0] / errors[1], order == 1 ? 3.4 : 6.5);
    EXPECT_GT(errors[1] / errors[2], order == 1 ? 3.4 : 6.5);
  }
}

/// A quarter of a ring of radii 1 and 2, whose foot has the tag 1 and whose inner side 2.
Mesh<2> hollow_sphere(int n) {
  Mesh<2> mesh = mapped(n, [](double a, double b) {
    const double t = kPi / 2 * b;
    return Vec<2>((1 + a) * Vec<2>(b == 1 ? 0 : std::cos(t), std::sin(t)));
  });
  for (const FacetId f : mesh.live_facets()) {
    const Vec<2> a = mesh.rest(mesh.facet(f)[0]), b = mesh.rest(mesh.facet(f)[1]);
    if (a[1] == 0 && b[1] == 0) mesh.set_facet_tag(f, 1);
    if (a.norm() < 1 + 1e-9 && b.norm() < 1 + 1e-9) mesh.set_facet_tag(f, 2);
  }
  return mesh;
}

/// Lame's hollow sphere, of polygons: half of one, from pole to pole on the axis, that nothing but the axis holds sideways.
TEST(Axisymmetry, HollowSphereUnderPressureIsLames) {
  const double p = 1, E = 1e4, nu = 0.3, C = p / 7;
  const auto exact = [&](const Vec<2>& X) {
    const double R = X.norm();
    return Vec<2>(C * ((1 - 2 * nu) / E * R + (1 + nu) / (2 * E) * 8 / (R * R)) * X / R);
  };
  for (const int order : {1, 2}) {
    std::vector<double> errors;
    for (const int n : {4, 8, 16}) {
      Scene setup = static_setup(hollow_sphere(n), order);
      setup.dirichlet.push_back({1, {false, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }});
      setup.pressure.push_back({2, [&](const Vec<2>&, double) { return p; }});
      errors.push_back(largest_error(setup, exact));
    }
    SCOPED_TRACE(order);
    RecordProperty("errors of order " + std::to_string(order), ::testing::PrintToString(errors));
    EXPECT_LT(errors[2], 1e-2);
    EXPECT_GT(errors[0] / errors[1], 3);
    EXPECT_GT(errors[1] / errors[2], 3.4);
  }
}

/// Lame's sphere, nearly incompressible: patches have errors of compressible bodies, where linear elements lock.
TEST(Axisymmetry, NearlyIncompressibleHollowSphereDoesNotLock) {
  const double p = 1e-3, E = 1e4, nu = 0.4999, C = p / 7;
  const auto exact = [&](const Vec<2>& X) {
    const double R = X.norm();
    return Vec<2>(C * ((1 - 2 * nu) / E * R + (1 + nu) / (2 * E) * 8 / (R * R)) * X / R);
  };
  const auto error = [&](int n, int order, VolumeForm volume) {
    Scene setup = static_setup(hollow_sphere(n), order);
    setup.materials[1] = {.youngs_modulus = E, .poisson_ratio = nu, .volume = volume};
    setup.dirichlet.push_back({1, {false, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }});
    setup.pressure.push_back({2, [&](const Vec<2>&, double) { return p; }});
    return largest_error(setup, exact);
  };
  for (const int order : {1, 2}) {
    const std::vector<double> errors = {error(4, order, VolumeForm::patches), error(8, order, VolumeForm::patches),
                                        error(16, order, VolumeForm::patches)};
    SCOPED_TRACE(order);
    RecordProperty("errors of order " + std::to_string(order), ::testing::PrintToString(errors));
    EXPECT_LT(errors[2], 1e-2);
    EXPECT_GT(errors[0] / errors[1], 3);
    EXPECT_GT(errors[1] / errors[2], 3);
  }
  EXPECT_GT(error(16, 1, VolumeForm::pointwise), 0.3);
}

/// A rod without Poisson's ratio swings along its axis as a bar does: a quarter of a period after it was hit it is at rest.
TEST(Axisymmetry, RodSwingsAlongItsAxis) {
  for (const auto& [integrator, tolerance] : {std::pair{Integrator::newmark, 1e-3}, std::pair{Integrator::bdf, 1e-3},
                                              std::pair{Integrator::implicit_euler, 0.05}}) {
    Scene setup = static_setup(mapped(6, [](double a, double b) { return Vec<2>(0.2 * a, b); }), 2);
    setup.materials[1] = {.youngs_modulus = 1e4, .poisson_ratio = 0, .density = 100};
    const double omega = kPi * 10, V = 1e-4;
    setup.time = {.integrator = integrator, .dt = 0.05 / 100, .steps = 100};
    setup.initial_velocity.push_back({1, [=](const Vec<2>& X, double) { return Vec<2>(0, V * std::cos(kPi * X[1])); }});
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    while (!simulation.finished()) advance(simulation);
    const auto& state = simulation.state();
    for (int v = 0; v < state.mesh.num_nodes(); ++v) {
      const Vec<2> X = state.mesh.point_of_node(v);
      const Vec<2> u = state.history.x[0].segment<2>(2 * v) - X, v_of = state.history.v[0].segment<2>(2 * v);
      EXPECT_NEAR(u[1], V / omega * std::cos(kPi * X[1]), tolerance * V / omega);
      EXPECT_NEAR(u[0], 0, tolerance * V / omega);
      EXPECT_NEAR(v_of[1], 0, 2 * tolerance * V);
    }
  }
}

double axial_momentum(const Simulation<2>& simulation) {
  const auto& state = simulation.state();
  const auto& setup = simulation.setup();
  VectorX product = VectorX::Zero(state.history.v[0].size());
  InertiaEnergy<2>(whole_mesh(state.mesh, setup.obstacles.rest), setup.materials, MassKind::consistent, product)
      .add_mass_product(state.history.v[0], product);
  return sum<2>(product)[1];
}

/// A disc falls on the ground and rebounds, with friction, remeshed: what the step keeps it keeps then, too.
TEST(Axisymmetry, ADiscThatFallsIsRemeshedAndKeepsItsMass) {
  Scene setup = static_setup(mapped(4, [](double a, double b) { return Vec<2>(0.2 * a, 0.2 * b); }), 1);
  setup.materials[1] = {.youngs_modulus = 1e4, .poisson_ratio = 0.4, .density = 1000};
  setup.time = {.integrator = Integrator::newmark, .dt = 0.005, .steps = 36};
  setup.obstacles.rest = {{-1, -0.01}, {1, -0.01}};
  setup.obstacles.edges = {{0, 1}};
  setup.obstacles.motion = {kNone, kNone};
  setup.contact = {.enabled = true, .dhat = 2e-3, .convergent = true, .barrier_stiffness = 1e4, .friction_coefficient = 0.2};
  setup.initial_velocity.push_back({1, [](const Vec<2>&, double) { return Vec<2>(0, -0.5); }});
  setup.remesh.enabled = true;
  setup.remesh.curve.enabled = true;
  setup.remesh.split.acceptance_tolerance = setup.remesh.curve.acceptance_tolerance = 1e-3;
  setup.remesh.collapse.acceptance_tolerance = -1e-4;
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  const double start = axial_momentum(simulation);
  EXPECT_NEAR(start, -0.5 * 1000 * kPi * 0.04 * 0.2, 1e-9);
  int edits = 0;
  double last = start;
  while (!simulation.finished()) {
    const StepResult result = advance(simulation);
    edits += result.report.splits.accepted + result.report.curves.accepted + result.report.collapses.accepted;
    const auto& state = simulation.state();
    for (int v = 0; v < state.mesh.num_nodes(); ++v) {
      const double r = state.history.x[0][2 * v];
      EXPECT_TRUE(state.mesh.is_on_axis(v) ? r == 0 : r > 0) << v;
    }
    last = axial_momentum(simulation);
    if (state.step == 1) {  // still in flight
      EXPECT_NEAR(last, start, 1e-9 * std::abs(start));
    }
  }
  EXPECT_GT(edits, 5);
  EXPECT_GT(last, -0.3 * start);  // upwards
}

/// A disc that flies and swings, remeshed: its momentum along the axis stays what it was.
TEST(Axisymmetry, RemeshingInFlightKeepsTheMomentumAlongTheAxis) {
  for (const int order : {1, 2}) {
    Scene setup = static_setup(mapped(4, [](double a, double b) { return Vec<2>(0.2 * a, 0.2 * b); }), order);
    setup.materials[1] = {.youngs_modulus = 1e4, .poisson_ratio = 0.4, .density = 1000};
    setup.time = {.integrator = Integrator::newmark, .dt = 0.005, .steps = 8};
    setup.initial_velocity.push_back(
        {1, [](const Vec<2>& X, double) { return Vec<2>(8 * X[0] * X[1], 1 + 20 * X[0] * X[0] - 30 * X[0] * X[1]); }});
    setup.remesh.enabled = setup.remesh.swap.enabled = setup.remesh.smooth.enabled = true;
    setup.remesh.split.acceptance_tolerance = 2e-3;
    setup.remesh.collapse.acceptance_tolerance = -2e-3;
    setup.remesh.collapse.rel_max_edge_length = 3;
    setup.newton.force_tolerance = 1e-12;
    linear::Registry registry;
    Simulation<2> simulation(setup, registry);
    const double start = axial_momentum(simulation);
    int edits = 0;
    while (!simulation.finished()) {
      const StepResult result = advance(simulation);
      const StepReport& r = result.report;
      edits += r.splits.accepted + r.collapses.accepted + r.swaps.accepted + r.smooths.accepted;
      EXPECT_NEAR(axial_momentum(simulation), start, 1e-9 * std::abs(start)) << "step " << simulation.state().step;
      const auto& state = simulation.state();
      for (int v = 0; v < state.mesh.num_nodes(); ++v)
        EXPECT_EQ(state.mesh.is_on_axis(v) ? state.history.v[0][2 * v] : 0, 0) << v;
    }
    EXPECT_GT(edits, 5);
  }
}

using AxisymmetricScene = scene::SceneTest;

TEST_F(AxisymmetricScene, IsReadAndErrorsNameTheirPlace) {
  const scene::json on = {{"axisymmetric", true}};
  EXPECT_FALSE(read2(square()).mesh.is_axisymmetric());
  EXPECT_TRUE(read2(square(on)).mesh.is_axisymmetric());
  scene::json moved = square(on);
  moved["geometry"][0]["transformation"] = {{"translation", {-0.25, 0}}};
  const auto beyond = failure(moved);
  EXPECT_EQ(beyond.place, "/geometry/0/mesh");
  EXPECT_NE(beyond.found.find("square.obj\" with vertex 0 at r = -0.25"), std::string::npos) << beyond.found;
  moved["geometry"][0]["transformation"] = {{"translation", {-1e-14, 0}}};
  EXPECT_EQ(read2(moved).mesh.rest(0)[0], 0);
  scene::json strained = square(on);
  strained["materials"][0]["plane_strain"] = true;
  EXPECT_EQ(failure(strained).place, "/materials/0/plane_strain");
  scene::json solid = square(on);
  solid["geometry"][0]["mesh"] = "tet.msh";
  EXPECT_EQ(failure(solid).place, "/axisymmetric");
}

TEST(Axisymmetry, WhatHasNoMeaningIsRefused) {
  linear::Registry registry;
  Scene setup = static_setup(mapped(2, [](double a, double b) { return Vec<2>(a - 0.5, b); }), 1);
  EXPECT_THROW(Simulation<2>(setup, registry), InputError);
  setup.mesh = mapped(2, [](double a, double b) { return Vec<2>(a, b); });
  LawSum sum = sum_of(law_rows()[0], 3, true);
  setup.materials[1] = material_of(sum, 2);
  EXPECT_THROW(Simulation<2>(setup, registry), InputError);
}

}  // namespace
}  // namespace itr
