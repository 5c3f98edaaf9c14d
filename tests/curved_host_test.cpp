// SPDX-License-Identifier: MIT
// Programs that embed the library, and conditions on points, on meshes with curved edges: forces stay whole, held lines stay
// held, states fit their mesh.
#include <gtest/gtest.h>

#include <cmath>

#include "curved_mesh.hpp"
#include "energy/elastic/jacobian_barrier.hpp"
#include "host_block.hpp"
#include "itr/core.hpp"
#include "itr/energy.hpp"
#include "random_quadratic.hpp"
#include "remesh/memory.hpp"

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
  const int tip = setup.mesh.node_slots() - 1;
  VectorX forces = VectorX::Zero(Dim * setup.mesh.node_slots());
  forces[Dim * tip + 1] = (Dim == 2 ? 20 : 1) * std::pow(kSize, Dim - 2);  // in 3D, more of it folds the cells at the tip
  setup.fields.applied_forces = true;
  auto simulation = simulate(setup);
  simulation.conditions().terms.push_back(point_forces<Dim>(setup.mesh, forces));
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(simulation.advance().ok);
  ASSERT_GT(simulation.state().mesh.num_curved(), 0);
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
  for (VertexId v = 0; v < setup.mesh.node_slots(); ++v)
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
  const auto rest = state.mesh.rest();
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

/// Remeshing of which nothing is accepted, so that only retries change the mesh.
void allow_retries(Setup<2>& setup) {
  setup.remesh.enabled = true;
  setup.remesh.collapse.enabled = false;
  setup.remesh.split.acceptance_tolerance = 1e9;
}

/// A block of quadratic elements that hits a table at five times the speed of its waves.
Setup<2> hitting_block() {
  auto setup = block<2>();
  add_table(setup);
  setup.time.dt = 0.002;
  setup.order[1] = 2;
  setup.initial_velocity.push_back({1, [](const Vec<2>&, double) { return Vec<2>(0, -50); }});
  setup.newton.step_tolerance = setup.newton.gradient_tolerance = 1e-8;
  return setup;
}

/// The barrier in the elastic energy keeps curved cells from stopping these; without it, they stop from 75 m/s on.
TEST(CurvedHost, ImpactsOfAnySpeedNeedNoRetries) {
  for (const double dt : {0.0005, 0.002, 0.01})
    for (const double speed : {30.0, 75.0, 120.0, 300.0, 1000.0}) {
      auto setup = hitting_block();
      setup.time.dt = dt;
      setup.initial_velocity[0].value = [speed](const Vec<2>&, double) { return Vec<2>(0, -speed); };
      allow_retries(setup);
      auto simulation = simulate(setup);
      for (int i = 0; i < 8; ++i) {
        const StepResult result = simulation.advance();
        ASSERT_TRUE(result.ok) << dt << ' ' << speed << ": " << result.reason;
        EXPECT_EQ(result.report.straightens.accepted, 0);
      }
    }
}

/// Newton's iterations are bounded, so that the impact stops.
TEST(CurvedHost, AStepThatCurvedCellsStopIsTakenAgainWithStraightEdges) {
  auto setup = hitting_block();
  setup.newton.max_iterations = 12;
  auto fixed = simulate(setup);
  int before = 0;
  while (before < 30 && fixed.advance().ok) ++before;
  ASSERT_LT(before, 30);
  allow_retries(setup);
  linear::Registry registry;
  int again = 0, changes = 0;
  Simulation<2> simulation(setup, registry, Logger([&](LogLevel level, std::string_view message) {
                             again += level == LogLevel::warning &&
                                      message.find("curved edges made straight") != std::string::npos;
                           }));
  simulation.on_mesh_change([&](const MeshChange<2>& change, const Mesh<2>& old_mesh) {
    ++changes;
    EXPECT_EQ(change.vertex.size(), static_cast<std::size_t>(old_mesh.num_vertices()));
  });
  for (int i = 0; i < before; ++i) ASSERT_TRUE(simulation.advance().ok);
  const int curved = simulation.state().mesh.num_curved();
  EXPECT_EQ(again, 0);
  const StepResult result = simulation.advance();
  ASSERT_TRUE(result.ok) << result.reason;
  EXPECT_EQ(again, 1);
  EXPECT_EQ(changes, 1);
  EXPECT_LT(simulation.state().mesh.num_curved(), curved);
  // Chords bring edges between them that become straight, too.
  EXPECT_GE(result.report.straightens.accepted, curved - simulation.state().mesh.num_curved());
  for (int i = before + 1; i < 30; ++i) ASSERT_TRUE(simulation.advance().ok);
}

/// One step of the block that needs so many retries, or fails for all of them, is told with all that was done.
void expect_report_of_retries(double speed, double dt, int max_iterations, int steps_before, int expected, bool succeeds) {
  auto setup = hitting_block();
  setup.newton.max_iterations = max_iterations;
  setup.time.dt = dt;
  setup.initial_velocity[0].value = [speed](const Vec<2>&, double) { return Vec<2>(0, -speed); };
  allow_retries(setup);
  linear::Registry registry;
  int retries = 0;
  Simulation<2> simulation(setup, registry, Logger([&](LogLevel level, std::string_view message) {
                             retries += level == LogLevel::warning &&
                                        message.find("curved edges made straight") != std::string::npos;
                           }));
  for (int i = 0; i < steps_before; ++i) ASSERT_TRUE(simulation.advance().ok);
  ASSERT_EQ(retries, 0);
  const int curved = simulation.state().mesh.num_curved();
  const StepResult result = simulation.advance();
  EXPECT_EQ(result.ok, succeeds) << result.reason;
  EXPECT_EQ(retries, expected);
  EXPECT_GE(result.report.straightens.accepted, curved - simulation.state().mesh.num_curved());  // chords are curved inside
  EXPECT_EQ(result.report.straightens.accepted > 0, succeeds);
  const StepSeconds& seconds = result.report.seconds;
  EXPECT_LE(
      seconds.assembly + seconds.linear_solve + seconds.line_search + seconds.ccd + seconds.remesh + seconds.projection,
      seconds.total);
}

TEST(CurvedHost, RetriesAreToldTogether) {
  expect_report_of_retries(100, 0.0005, 14, 1, 1, true);
  expect_report_of_retries(150, 0.0005, 10, 0, 2, false);
}

/// The first two leave edges curved whose straightening nearly inverts cells.
TEST(CurvedHost, TheLastRetrySavesImpacts) { expect_report_of_retries(50, 0.005, 14, 1, 3, true); }

/// Positions of quadratic elements that are positive everywhere, which the parts of the barrier cannot prove, by a random
/// motion of some nodes.
VectorX unproven(const Setup<2>& setup, const std::vector<int>& nodes, std::mt19937& random) {
  const Mesh<2> mesh = of_orders(setup.mesh, setup.order);
  const CellSet<2> cells = whole_mesh(mesh, {});
  const auto is_positive = [&](const VectorX& x) {
    return std::ranges::all_of(
        cells.curved(), [&](const auto& element) { return is_positive_everywhere_exact<2>(at_all_nodes<2>(element, x)); });
  };
  const auto is_proven = [&](const VectorX& x) {
    return std::ranges::all_of(cells.curved(), [&](const auto& element) {
      return std::isfinite(JacobianBarrier<2>(element, at_nodes<2>(element.nodes(), x)).value());
    });
  };
  const auto& places = mesh.rest();
  VectorX rest(2 * places.size()), x = rest;
  for (std::size_t v = 0; v < places.size(); ++v) rest.segment<2>(2 * static_cast<int>(v)) = places[v];
  std::uniform_real_distribution<double> part(-kSize, kSize);
  do {
    VectorX step = VectorX::Zero(rest.size());
    for (const int node : nodes) step.segment<2>(2 * node) = Vec<2>(part(random), part(random));
    double valid = 0, inverted = 1;
    while (inverted - valid > 1e-6) {
      const double t = (valid + inverted) / 2;
      (is_positive(rest + t * step) ? valid : inverted) = t;
    }
    x = rest + valid * step;
  } while (is_proven(x));
  return x;
}

/// The first step from given positions.
std::pair<StepResult, int> step_from(const Setup<2>& setup, const VectorX& x) {
  auto simulation = simulate(setup);
  State<2> state = simulation.state();
  state.history.x[0] = x;
  simulation.restore(std::move(state));
  StepResult result = simulation.advance();
  return {std::move(result), simulation.state().mesh.num_curved()};
}

TEST(CurvedHost, AValidStateOfInfiniteEnergyGoesOnWithStraightEdges) {
  auto setup = block<2>();
  setup.mesh = Mesh<2>({{0, 0}, {kSize, 0}, {0, kSize}}, {{0, 1, 2}}, {1});
  setup.order[1] = 2;
  setup.body_acceleration = nullptr;
  std::mt19937 random(4);
  int saved = 0;
  for (int i = 0; i < 10; ++i) {
    const VectorX x = unproven(setup, {0, 1, 2, 3, 4, 5}, random);
    setup.remesh.enabled = false;
    EXPECT_FALSE(step_from(setup, x).first.ok);
    allow_retries(setup);
    const StepResult result = step_from(setup, x).first;
    saved += result.ok;
    EXPECT_EQ(result.report.straightens.accepted > 0, result.ok) << result.reason;
  }
  EXPECT_GT(saved, 3);
}

/// The first retry changes what is near cells that are nearly inverted, here one at a corner of the block.
TEST(CurvedHost, TheFirstRetryKeepsCurvesElsewhere) {
  auto setup = block<2>();
  setup.order[1] = 2;
  setup.body_acceleration = nullptr;
  allow_retries(setup);
  const Mesh<2> mesh = of_orders(setup.mesh, setup.order);
  VertexId corner = 0;
  while (setup.mesh.cells_of(corner).size() != 1) ++corner;
  std::vector<int> nodes;
  for (const VertexId v : setup.mesh.cell(setup.mesh.cells_of(corner)[0]))
    if (v != corner) nodes.push_back(mesh.node_of(corner, v));
  std::mt19937 random(4);
  int kept = 0;
  for (int i = 0; i < 10; ++i) {
    const auto [result, curved] = step_from(setup, unproven(setup, nodes, random));
    EXPECT_EQ(curved < mesh.num_curved(), result.ok) << result.reason;
    kept += result.ok && curved > 0;
  }
  EXPECT_GT(kept, 3);
}

/// The densities of output are the energy of the report, also where the barrier acts.
TEST(CurvedHost, DensitiesOfDistortedCellsSumUpToTheElasticEnergy) {
  auto setup = hitting_block();
  setup.initial_velocity[0].value = [](const Vec<2>&, double) { return Vec<2>(0, -1000); };
  auto simulation = simulate(setup);
  int acting = 0;
  for (int i = 0; i < 6; ++i) {
    const StepResult result = simulation.advance();
    ASSERT_TRUE(result.ok) << result.reason;
    const State<2>& state = simulation.state();
    const CellSet<2> cells = whole_mesh(state.mesh, {});
    for (const auto& element : cells.curved())
      acting += JacobianBarrier<2>(element, at_nodes<2>(element.nodes(), state.history.x[0])).is_active();
    double sum = 0;
    simulation.observe([&](const FrameView<2>& frame) {
      for (CellId c = 0; c < state.mesh.cell_slots(); ++c) sum += state.mesh.volume(c) * frame.elastic_density[c];
    });
    EXPECT_NEAR(sum, result.report.energy.elastic, 1e-10 * sum);
  }
  EXPECT_GT(acting, 0);
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
  while (!curved.state().mesh.has_nodes()) ASSERT_TRUE(curved.advance().ok);
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
  constexpr int kSplit = static_cast<int>(OperationKind::split), kCollapse = static_cast<int>(OperationKind::collapse);
  RemeshMemory memory;
  std::array<double, kOperationKinds> tolerances{};
  tolerances[kSplit] = 10;
  tolerances[kCollapse] = -1;
  memory.begin(tolerances);
  for (const OperationKind kind : {OperationKind::split, OperationKind::collapse})
    memory.refusals.push_back({Candidate(kind, EdgeKey{0, 1}), {1, 2, false}});
  const auto remembers = [&](double split, double collapse) {
    RemeshMemory copy = memory;
    tolerances[kSplit] = split;
    tolerances[kCollapse] = collapse;
    copy.begin(tolerances);
    const auto holds = [&](OperationKind kind) {
      return std::ranges::any_of(copy.refusals, [&](const auto& entry) { return entry.candidate.kind() == kind; });
    };
    return std::array{holds(OperationKind::split), holds(OperationKind::collapse)};
  };
  EXPECT_EQ(remembers(9, -1.1), (std::array{true, true}));
  EXPECT_EQ(remembers(20, -0.5), (std::array{true, true}));
  EXPECT_EQ(remembers(8, -1), (std::array{false, true}));
  EXPECT_EQ(remembers(10, -1.3), (std::array{true, false}));
}

}  // namespace
}  // namespace itr
