// SPDX-License-Identifier: MIT
// Programs that embed the library, and conditions on points, on meshes with curved edges: forces stay whole, held lines stay
// held, states fit their mesh.
#include <gtest/gtest.h>

#include <cmath>

#include "host_block.hpp"
#include "itr/core/error.hpp"
#include "itr/energy/point_forces.hpp"
#include "itr/remesh/memory.hpp"

namespace itr {
namespace {

/// A block clamped on its left and bent by its weight, of which remeshing curves edges.
template <int Dim>
Setup<Dim> curving_block() {
  auto setup = block<Dim>();
  setup.dirichlet.push_back({1, {true, true}, [](const Vec<Dim>&, double) { return Vec<Dim>(Vec<Dim>::Zero()); }});
  if constexpr (Dim == 3) setup.dirichlet.back().components[2] = true;
  setup.materials[1].youngs_modulus = 2e4;
  setup.remesh.enabled = setup.remesh.curve.enabled = true;
  setup.remesh.split.acceptance_tolerance = 1e-3 * std::pow(kSize, Dim - 2);
  return setup;
}

template <int Dim>
void expect_whole_forces() {
  auto setup = curving_block<Dim>();
  const int tip = setup.mesh.vertex_slots() - 1;
  VectorX forces = VectorX::Zero(Dim * setup.mesh.vertex_slots());
  forces[Dim * tip + 1] = 20 * std::pow(kSize, Dim - 2);
  setup.fields.applied_forces = true;
  auto simulation = simulate(setup);
  simulation.conditions().terms.push_back(point_forces<Dim>(setup.mesh, forces));
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(simulation.advance().ok);
  ASSERT_GT(simulation.state().space.num_curved(), 0);
  EXPECT_LT((sum<Dim>(simulation.forces().applied) - sum<Dim>(forces)).norm(), 1e-12 * forces.norm());
}

TEST(CurvedHost, ForcesActWhereEdgesAreCurved) {
  expect_whole_forces<2>();
  expect_whole_forces<3>();
}

/// Facets of the left have no tag of a condition then; all vertices there have one.
template <int Dim>
Setup<Dim> held_by_points(Setup<Dim> setup) {
  constexpr int kPoints = 77;
  for (VertexId v = 0; v < setup.mesh.vertex_slots(); ++v)
    if (setup.mesh.rest(v)[0] < 1e-9) setup.mesh.set_vertex_tag(v, kPoints);
  for (auto& condition : setup.dirichlet)
    if (condition.tag == 1) condition.tag = kPoints;
  return setup;
}

template <int Dim>
void expect_points_to_hold_lines() {
  auto simulation = simulate(held_by_points(curving_block<Dim>()));
  for (int i = 0; i < 6; ++i) ASSERT_TRUE(simulation.advance().ok);
  const State<Dim>& state = simulation.state();
  const auto rest = node_rest_positions(state.mesh, state.space);
  for (std::size_t v = 0; v < rest.size(); ++v) {
    if (rest[v][0] > 1e-9) continue;
    for (const auto& x : state.history.x)
      EXPECT_EQ(Vec<Dim>(x.template segment<Dim>(Dim * static_cast<int>(v))), rest[v]) << v;
  }
}

TEST(CurvedHost, PointsOfOneIdHoldTheCurvedEdgesBetweenThem) {
  expect_points_to_hold_lines<2>();
  expect_points_to_hold_lines<3>();
  auto setup = curving_block<2>();
  setup.remesh.enabled = false;
  setup.order[1] = 2;
  auto by_facets = simulate(setup), by_points = simulate(held_by_points(setup));
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(by_facets.advance().ok);
    ASSERT_TRUE(by_points.advance().ok);
  }
  EXPECT_EQ(by_points.state().history.x[0], by_facets.state().history.x[0]);
}

TEST(CurvedHost, AStateOfAnAdaptedMeshHasItsOwnLevelsOfQuadrature) {
  auto setup = block<2>();
  setup.body_acceleration = nullptr;
  setup.time = {.dt = 0.02, .steps = 1000};
  setup.time.quasistatic = true;
  setup.order[1] = 2;
  setup.materials[1].youngs_modulus = 2e4;
  for (int f = 0; f < setup.mesh.facet_slots(); ++f) {
    double bottom = 0;
    for (const int v : setup.mesh.facet(f)) bottom = std::max(bottom, setup.mesh.rest(v)[1]);
    if (bottom < 1e-9) setup.mesh.set_facet_tag(f, 4);
  }
  setup.dirichlet.push_back({4, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }});
  setup.dirichlet.push_back({2, {true, true}, [](const Vec<2>&, double t) { return Vec<2>(0.3 * t, -0.14 * t); }});
  setup.remesh.enabled = true;
  setup.remesh.split.acceptance_tolerance = 0.1;
  setup.newton.step_tolerance = setup.newton.gradient_tolerance = 1e-8;
  auto simulation = simulate(setup);
  simulation.conditions().remesh.enabled = false;
  int steps = 0;
  while (simulation.state().quadrature.empty() && steps++ < 60) ASSERT_TRUE(simulation.advance().ok);
  ASSERT_FALSE(simulation.state().quadrature.empty());
  simulation.conditions().remesh.enabled = true;
  const int before = simulation.state().mesh.num_cells();
  ASSERT_TRUE(simulation.adapt(setup.time.dt).ok);
  ASSERT_NE(simulation.state().mesh.num_cells(), before);
  State<2> state = simulation.state();
  EXPECT_EQ(state.quadrature.size(), static_cast<std::size_t>(state.mesh.num_cells()));
  EXPECT_NO_THROW(simulation.restore(std::move(state)));
}

/// A block of quadratic elements that hits a table so fast that a cell is nearly inverted.
Setup<2> hitting_block() {
  auto setup = block<2>();
  add_table(setup);
  setup.time.dt = 0.002;
  setup.order[1] = 2;
  setup.initial_velocity.push_back({1, [](const Vec<2>&, double) { return Vec<2>(0, -50); }});
  setup.newton.step_tolerance = setup.newton.gradient_tolerance = 1e-8;
  return setup;
}

TEST(CurvedHost, AStepThatCurvedCellsStopIsTakenAgainWithStraightEdges) {
  auto setup = hitting_block();
  auto fixed = simulate(setup);
  int before = 0;
  while (before < 30 && fixed.advance().ok) ++before;
  ASSERT_LT(before, 30);
  setup.remesh.enabled = true;
  setup.remesh.collapse.enabled = false;
  setup.remesh.split.acceptance_tolerance = 1e9;
  linear::Registry registry;
  int again = 0, changes = 0;
  Simulation<2> simulation(setup, registry, Logger([&](LogLevel level, std::string_view message) {
                             again += level == LogLevel::warning &&
                                      message.find("curved edges made straight") != std::string::npos;
                           }));
  simulation.on_mesh_change([&](const MeshChange<2>& change, const Mesh<2>& old_mesh) {
    ++changes;
    EXPECT_EQ(change.vertex.size(), static_cast<std::size_t>(old_mesh.vertex_slots()));
  });
  for (int i = 0; i < before; ++i) ASSERT_TRUE(simulation.advance().ok);
  const int curved = simulation.state().space.num_curved();
  EXPECT_EQ(again, 0);
  const StepResult result = simulation.advance();
  ASSERT_TRUE(result.ok) << result.reason;
  EXPECT_EQ(again, 1);
  EXPECT_EQ(changes, 1);
  EXPECT_LT(simulation.state().space.num_curved(), curved);
  // Chords bring edges between them that become straight, too.
  EXPECT_GE(result.report.straightens.accepted, curved - simulation.state().space.num_curved());
  for (int i = before + 1; i < 30; ++i) ASSERT_TRUE(simulation.advance().ok);
}

/// One step of the block that needs so many retries, or fails for all of them, is told with all that was done.
void expect_report_of_retries(double speed, double dt, int steps_before, int expected, bool succeeds) {
  auto setup = hitting_block();
  setup.time.dt = dt;
  setup.initial_velocity[0].value = [speed](const Vec<2>&, double) { return Vec<2>(0, -speed); };
  setup.remesh.enabled = true;
  setup.remesh.collapse.enabled = false;
  setup.remesh.split.acceptance_tolerance = 1e9;
  linear::Registry registry;
  int retries = 0;
  Simulation<2> simulation(setup, registry, Logger([&](LogLevel level, std::string_view message) {
                             retries += level == LogLevel::warning &&
                                        message.find("curved edges made straight") != std::string::npos;
                           }));
  for (int i = 0; i < steps_before; ++i) ASSERT_TRUE(simulation.advance().ok);
  ASSERT_EQ(retries, 0);
  const int curved = simulation.state().space.num_curved();
  const StepResult result = simulation.advance();
  EXPECT_EQ(result.ok, succeeds) << result.reason;
  EXPECT_EQ(retries, expected);
  EXPECT_GE(result.report.straightens.accepted, curved - simulation.state().space.num_curved());  // chords are curved inside
  EXPECT_EQ(result.report.straightens.accepted > 0, succeeds);
  const StepSeconds& seconds = result.report.seconds;
  EXPECT_LE(
      seconds.assembly + seconds.linear_solve + seconds.line_search + seconds.ccd + seconds.remesh + seconds.projection,
      seconds.total);
}

TEST(CurvedHost, RetriesAreToldTogether) {
  expect_report_of_retries(90, 0.003, 1, 1, true);
  expect_report_of_retries(75, 0.001, 3, 3, false);
}

/// The first two leave edges curved whose straightening nearly inverts cells.
TEST(CurvedHost, TheLastRetrySavesImpacts) {
  expect_report_of_retries(115, 0.002, 1, 3, true);
  expect_report_of_retries(75, 0.003, 1, 3, true);
}

TEST(CurvedHost, RemeshingMayBeSwitchedOnLater) {
  auto setup = pressed_block();
  setup.remesh = {};
  auto simulation = simulate(setup);
  ASSERT_TRUE(simulation.advance().ok);
  simulation.conditions().remesh.enabled = true;
  ASSERT_TRUE(simulation.advance().ok);
  EXPECT_GT(*simulation.setup().remesh.split.acceptance_tolerance, 0);
  simulation.conditions().remesh.split.acceptance_tolerance.reset();
  simulation.conditions().lump_mass = simulation.conditions().remesh.curve.enabled = true;
  EXPECT_THROW(simulation.advance(), InputError);
}

TEST(CurvedHost, LumpedMassIsRefusedWhereRemeshingFindsCurvedEdges) {
  auto curved = simulate(curving_block<2>());
  while (curved.state().space.is_linear()) ASSERT_TRUE(curved.advance().ok);
  for (const bool was_enabled : {false, true}) {
    auto setup = curving_block<2>();
    setup.remesh.curve.enabled = false;
    setup.remesh.enabled = was_enabled;
    setup.lump_mass = true;
    auto simulation = simulate(setup);
    ASSERT_TRUE(simulation.advance().ok);
    simulation.conditions().remesh.enabled = false;
    simulation.restore(State<2>(curved.state()));
    EXPECT_TRUE(simulation.advance().ok);
    simulation.conditions().remesh.enabled = true;
    EXPECT_THROW(simulation.advance(), InputError);
    EXPECT_THROW(simulation.adapt(setup.time.dt), InputError);
  }
}

TEST(CurvedHost, ASizingFieldMeasuresStraightFacetsAlone) {
  auto setup = pressed_block();
  setup.remesh.sizing_field.enabled = true;
  setup.remesh.curve.enabled = false;
  setup.order.clear();
  EXPECT_NO_THROW(simulate(setup));
  setup.order[1] = 2;
  EXPECT_THROW(simulate(setup), InputError);
}

TEST(CurvedHost, RemeshingMayBeSwitchedOnLaterWithAToleranceOfItsOwn) {
  auto setup = pressed_block();
  setup.remesh = {};
  setup.remesh.split.acceptance_tolerance = 1e-3;
  auto simulation = simulate(setup);
  simulation.conditions().remesh.enabled = true;
  ASSERT_TRUE(simulation.advance().ok);
  const RemeshOptions& remesh = simulation.setup().remesh;
  EXPECT_EQ(remesh.split.acceptance_tolerance, 1e-3);
  EXPECT_TRUE(remesh.collapse.acceptance_tolerance && remesh.split.min_edge_length);
}

TEST(Memory, ForgetsRefusalsByStricterTolerances) {
  using Memory = RemeshMemory;
  Memory memory;
  std::array<double, Memory::kKinds> tolerances{};
  tolerances[Memory::split] = 10;
  tolerances[Memory::collapse] = -1;
  memory.begin(tolerances);
  memory.refusals[Memory::split] = memory.refusals[Memory::collapse] = {{Place(EdgeKey{0, 1}), {1, 2, false}}};
  const auto remembers = [&](double split, double collapse) {
    Memory copy = memory;
    tolerances[Memory::split] = split;
    tolerances[Memory::collapse] = collapse;
    copy.begin(tolerances);
    return std::array{!copy.refusals[Memory::split].empty(), !copy.refusals[Memory::collapse].empty()};
  };
  EXPECT_EQ(remembers(9, -1.1), (std::array{true, true}));
  EXPECT_EQ(remembers(20, -0.5), (std::array{true, true}));
  EXPECT_EQ(remembers(8, -1), (std::array{false, true}));
  EXPECT_EQ(remembers(10, -1.3), (std::array{true, false}));
}

}  // namespace
}  // namespace itr
