// SPDX-License-Identifier: MIT
// History on a mesh that is coarsened: momentum, prescribed components, and bodies far away stay.
#include <gtest/gtest.h>

#include <random>

#include "energy/contact/contact.hpp"
#include "energy/inertia.hpp"
#include "fem/inverted.hpp"
#include "itr/solver.hpp"
#include "projection/safe_projection.hpp"
#include "random_cube.hpp"
#include "random_mesh.hpp"
#include "simulation/contact_surface.hpp"
#include "simulation/history_transfer.hpp"

namespace itr {
namespace {

constexpr double kRoundOff = 1e-12;

/// Two squares of 12 x 12 quadrilaterals: one on its own, one 3 m to the right that rests on a table, half of dhat above it.
struct Scene {
  std::mt19937 random;
  Setup<2> setup;
  Mesh<2> old_mesh, mesh;
  History old_history, history;
  TouchedCells touched;
  linear::Registry registry;
  std::unique_ptr<linear::Solver> solver = registry.create("eigen:llt");

  explicit Scene(unsigned seed) : random(seed) {
    Mesh<2> one = random_mesh(12, random);
    std::vector<Vec<2>> rest;
    std::vector<std::array<int, 3>> cells;
    std::vector<int> body;
    for (int i = 0; i < 2; ++i) {
      for (int v = 0; v < one.node_slots(); ++v) rest.emplace_back(one.rest(v) + Vec<2>(3 * i, 0));
      for (int c = 0; c < one.cell_slots(); ++c) {
        auto cell = one.cell(c);
        for (int& v : cell) v += i * one.node_slots();
        cells.push_back(cell);
        body.push_back(one.body(c));
      }
    }
    setup.mesh = old_mesh = Mesh<2>(rest, cells, body);
    setup.materials[1] = {.youngs_modulus = 1e5, .density = 2};
    setup.materials[2] = {.youngs_modulus = 1e5, .density = 5};
    setup.contact = {.enabled = true, .dhat = 1e-2};
    setup.time = {.dt = 0.01};
    setup.obstacles.rest = {{2.5, -5e-3}, {4.5, -5e-3}};
    setup.obstacles.edges = {{0, 1}};
    const int bodies = old_mesh.node_slots();
    VectorX x(2 * (bodies + 2)), v = VectorX::Random(x.size());
    for (int i = 0; i < bodies; ++i) x.segment<2>(2 * i) = old_mesh.rest(i);
    for (int o = 0; o < 2; ++o) x.segment<2>(2 * (bodies + o)) = setup.obstacles.rest[o];
    v.tail(4).setZero();
    old_history = {.x = {x}, .v = {v}, .a = {}};
  }

  /// The first body, bent.
  void bend() {
    for (int v = 0; v < old_mesh.node_slots() / 2; ++v) {
      const Vec<2> X = old_mesh.rest(v);
      old_history.x[0].segment<2>(2 * v) += 0.02 * Vec<2>(std::sin(9 * X[0] + X[1]), std::cos(8 * X[1] - X[0]));
    }
  }

  /// Collapses edges of the first body that `may` be, and carries the history over by interpolation.
  template <typename May>
  void coarsen(int collapses, May&& may) {
    mesh = old_mesh;
    RemeshFields<2> fields;
    const int dofs = 2 * old_mesh.node_slots();
    fields.past_positions = {old_history.x[0].head(dofs)};
    fields.past_rates = {old_history.v[0].head(dofs)};
    const auto edges = old_mesh.edges();
    for (int i = 0; collapses > 0 && i < 10000; ++i) {
      const EdgeKey edge = edges[random() % edges.size()];
      if (mesh.rest(edge[0])[0] > 1.5 || !may(edge) || mesh.cells_of_edge(edge).empty()) continue;
      const auto edit = propose_collapse(mesh, Strata<2>(mesh), edge).edit;
      if (!edit) continue;
      RemeshFields<2> next = fields;
      Mesh<2> changed = mesh;
      next.follow(*edit, changed.apply(*edit));
      if (find_inverted<2>(changed, next.past_positions[0]) != kNone) continue;
      mesh = std::move(changed);
      fields = std::move(next);
      --collapses;
    }
    for (int c = 0; c < old_mesh.cell_slots(); ++c)
      if (!mesh.is_cell_alive(c)) touched.old_cells.push_back(c);
    const auto map = mesh.compact();
    for (int c = old_mesh.cell_slots(); c < static_cast<int>(map.cell.size()); ++c)
      if (map.cell[c] != kNone) touched.new_cells.push_back(map.cell[c]);
    const auto carried = [&](const VectorX& slots, const VectorX& with_obstacles) {
      VectorX field(2 * mesh.node_slots() + 4);
      for (std::size_t v = 0; v < map.vertex.size(); ++v)
        if (map.vertex[v] != kNone) field.segment<2>(2 * map.vertex[v]) = slots.segment<2>(2 * static_cast<int>(v));
      field.tail<4>() = with_obstacles.tail<4>();
      return field;
    };
    history = {.x = {carried(fields.past_positions[0], old_history.x[0])},
               .v = {carried(fields.past_rates[0], old_history.v[0])},
               .a = {}};
  }

  HistoryTransferReport transfer() {
    return transfer_history(setup, old_mesh, old_history, mesh, touched, *solver, history);
  }

  /// Integral of rho u over all bodies.
  Vec<2> integral(const Mesh<2>& of, const VectorX& u) const {
    Vec<2> sum = Vec<2>::Zero();
    for (int c = 0; c < of.cell_slots(); ++c)
      for (const int v : of.cell(c)) sum += setup.materials.at(of.body(c)).density * of.volume(c) / 3 * u.segment<2>(2 * v);
    return sum;
  }
  void expect_integrals_kept() const {
    for (const auto& [now, before] : {std::pair(&history.x[0], &old_history.x[0]), {&history.v[0], &old_history.v[0]}})
      EXPECT_LE((integral(mesh, *now) - integral(old_mesh, *before)).norm(),
                kRoundOff * integral(old_mesh, before->cwiseAbs()).norm());
  }
};

TEST(HistoryTransfer, BodyThatRestsFarAwayDoesNotMatter) {
  Scene scene(1);
  scene.bend();
  scene.coarsen(40, [](const EdgeKey&) { return true; });
  const History interpolated = scene.history;
  const auto report = scene.transfer();
  EXPECT_EQ(report.with_barriers, 0);
  EXPECT_LE(report.lost_positions, 1e-15);
  scene.expect_integrals_kept();
  EXPECT_GT((scene.history.x[0] - interpolated.x[0]).norm(), 1e-3);
  EXPECT_GT((scene.history.v[0] - interpolated.v[0]).norm(), 1e-3);
  for (int v = 0; v < scene.mesh.node_slots(); ++v)
    if (scene.mesh.rest(v)[0] > 1.5) {
      EXPECT_EQ(scene.history.x[0].segment<2>(2 * v), interpolated.x[0].segment<2>(2 * v));
      EXPECT_EQ(scene.history.v[0].segment<2>(2 * v), interpolated.v[0].segment<2>(2 * v));
    }
  EXPECT_EQ(scene.history.x[0].tail<4>(), interpolated.x[0].tail<4>());
}

TEST(HistoryTransfer, IsLeftOutWhereNothingDependsOnThePast) {
  using Change = void (*)(itr::Setup<2>&);
  const Change inertia = [](itr::Setup<2>& setup) { setup.time.quasistatic = false; };
  const Change friction = [](itr::Setup<2>& setup) { setup.contact.friction_coefficient = 0.1; };
  const Change damping = [](itr::Setup<2>& setup) { setup.damping.push_back({.coefficient = 0.1}); };
  const Change nothing = [](itr::Setup<2>&) {};
  for (const Change change : {inertia, friction, damping, nothing}) {
    Scene scene(1);
    scene.setup.time.quasistatic = true;
    change(scene.setup);
    scene.bend();
    scene.coarsen(40, [](const EdgeKey&) { return true; });
    const History interpolated = scene.history;
    scene.transfer();
    EXPECT_EQ(scene.history.x[0] == interpolated.x[0], change == nothing);
    EXPECT_EQ(scene.history.v[0] == interpolated.v[0], change == nothing);
  }
}

/// Where bodies rest right at the touched cells, past positions are well where they are: no barrier pushes them apart.
TEST(HistoryTransfer, RestingContactAtTheTouchedCellsPushesNothing) {
  Scene scene(2);
  scene.setup.obstacles.rest = {{-0.5, -5e-3}, {1.5, -5e-3}};
  scene.old_history.x[0].tail<4>() << -0.5, -5e-3, 1.5, -5e-3;
  scene.coarsen(40, [](const EdgeKey&) { return true; });
  const History interpolated = scene.history;
  const auto report = scene.transfer();
  EXPECT_EQ(report.with_barriers, 0);
  EXPECT_LE((scene.history.x[0] - interpolated.x[0]).norm(), 1e-13);  // linear: nothing to project
  scene.expect_integrals_kept();
}

/// A collapse at a dent that a peak of the table fills: the projection would go through it.
TEST(HistoryTransfer, ForcedBarrierKeepsIntegralsAndValidity) {
  int forced = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    Scene scene(seed);
    const int n = scene.old_mesh.node_slots() / 2;
    auto& x = scene.old_history.x[0];
    for (int v = 0; v < n; ++v) {  // waves along the bottom that the coarser mesh cannot follow
      const Vec<2> X = scene.old_mesh.rest(v);
      x[2 * v + 1] += 0.01 * std::exp(-20 * X[1]) * std::sin(60 * X[0]);
    }
    double lowest = 1;
    scene.coarsen(30, [&](const EdgeKey& e) { return scene.old_mesh.rest(e[0])[1] < 0.3; });
    for (int v = 0; v < scene.mesh.node_slots(); ++v)
      if (scene.mesh.rest(v)[0] < 1.5) lowest = std::min(lowest, scene.history.x[0][2 * v + 1]);
    const double y = lowest - 1e-6;  // a table right below the interpolant
    scene.setup.obstacles.rest = {{-0.5, y}, {1.5, y}};
    for (History* history : {&scene.old_history, &scene.history}) history->x[0].tail<4>() << -0.5, y, 1.5, y;
    const auto report = scene.transfer();
    forced += report.with_barriers;
    EXPECT_EQ(report.not_converged, 0) << seed;
    scene.expect_integrals_kept();
    EXPECT_EQ(find_inverted<2>(scene.mesh, scene.history.x[0].head(2 * scene.mesh.node_slots())), kNone);
    EXPECT_FALSE(has_intersection<2>(collision_surface(scene.mesh, scene.setup.obstacles), scene.history.x[0])) << seed;
  }
  EXPECT_GT(forced, 3);
}

/// Barriers that act in one place are asked there alone: more rings change next to nothing.
TEST(SafeProjection, GoesStraightFarFromWhatStopsIt) {
  std::mt19937 random(5);
  const Mesh<2> mesh = random_mesh(16, random);
  const int n = mesh.node_slots();
  CellSet<2> cells = whole_mesh<2>(mesh, {{-1, -1e-4}, {2, -1e-4}});
  std::map<int, Material> materials;
  for (const int body : {1, 2}) materials[body].density = 2;
  std::vector<char> counts(n + 2, 1), held(2 * (n + 2), 0);
  counts[n] = counts[n + 1] = 0;
  std::fill(held.end() - 4, held.end(), 1);
  std::vector<std::array<int, 2>> edges{{n, n + 1}};
  for (int f = 0; f < mesh.facet_slots(); ++f) edges.push_back(mesh.facet(f));
  const CollisionSurface surface = make_collision_surface<2>(edges, {}, {}, cells.rest, counts);
  VectorX interpolant(2 * (n + 2));
  for (int v = 0; v < n + 2; ++v) interpolant.segment<2>(2 * v) = cells.rest[v];
  VectorX goal = interpolant;
  for (int v = 0; v < n; ++v) {  // a bulge through the table, waves elsewhere
    const Vec<2> X = cells.rest[v];
    goal.segment<2>(2 * v) += 2e-3 * Vec<2>(std::sin(9 * X[1]), std::cos(7 * X[0]) * X[1]);
    goal[2 * v + 1] -= 4e-3 * std::exp(-200 * (X - Vec<2>(0.5, 0)).squaredNorm());
  }
  linear::Registry registry;
  const auto solver = registry.create("eigen:llt");
  const InertiaEnergy<2> distance(cells, materials, MassKind::consistent, goal);
  const auto project = [&](int rings, int* straight) {
    SafeProjectionReport<2> report;
    const VectorX x = project_safely<2>({cells, &surface, materials, 1e-2, held, std::vector<int>(n, 0), rings}, interpolant,
                                        goal, *solver, report);
    EXPECT_TRUE(report.used_barriers && report.converged);
    EXPECT_FALSE(has_intersection<2>(surface, x));
    EXPECT_EQ(find_inverted<2>(mesh, x.head(2 * n)), kNone);
    EXPECT_LE(report.lost.norm(), kRoundOff);
    for (int v = 0; v < n; ++v) *straight += x.segment<2>(2 * v) == goal.segment<2>(2 * v);
    Workspace workspace;
    return distance.value(x, workspace);
  };
  int straight = 0, none = 0;
  const double local = project(4, &straight), whole = project(100, &none);
  EXPECT_GT(straight, n / 3);
  EXPECT_LT(none, n / 10);
  EXPECT_GT(whole, 0);
  EXPECT_NEAR(local, whole, 0.05 * whole);
}

/// Rollers prescribe one component: the other one is free.
TEST(HistoryTransfer, BodyOnRollersSlides) {
  Scene scene(3);
  scene.setup.dirichlet = {{.tag = 2, .components = {false, true}, .displacement = {}}};
  for (int f = 0; f < scene.old_mesh.facet_slots(); ++f) {
    const auto& facet = scene.old_mesh.facet(f);
    const bool bottom = scene.old_mesh.rest(facet[0])[1] == 0 && scene.old_mesh.rest(facet[1])[1] == 0;
    scene.old_mesh.set_facet_tag(f, bottom ? 2 : 1);
  }
  for (int v = 0; v < scene.old_mesh.node_slots() / 2; ++v) {
    const Vec<2> X = scene.old_mesh.rest(v);
    scene.old_history.x[0].segment<2>(2 * v) +=
        0.02 * Vec<2>(std::sin(30 * X[0] + X[1]), std::sin(9 * X[1]) * std::cos(20 * X[0]));
  }
  scene.coarsen(25, [&](const EdgeKey& e) { return scene.old_mesh.rest(e[0])[1] < 0.3; });
  const History interpolated = scene.history;
  const auto report = scene.transfer();
  EXPECT_EQ(report.with_barriers, 0);
  scene.expect_integrals_kept();
  double slid = 0;
  for (int v = 0; v < scene.mesh.node_slots(); ++v)
    if (scene.mesh.rest(v)[1] == 0) {
      EXPECT_EQ(scene.history.x[0][2 * v + 1], interpolated.x[0][2 * v + 1]);
      slid = std::max(slid, std::abs(scene.history.x[0][2 * v] - interpolated.x[0][2 * v]));
    }
  EXPECT_GT(slid, 1e-5);
}

/// A pin holds a vertex, not a facet: its past positions stay as prescribed too.
TEST(HistoryTransfer, PinsHoldVertices) {
  Scene scene(5);
  scene.bend();
  scene.setup.dirichlet = {{.tag = 7, .components = {true, true}, .displacement = {}},
                           {.tag = 8, .components = {false, true}, .displacement = {}}};
  const std::map<int, Vec<2>> places = {{7, {0.5, 0}}, {8, {0, 0.5}}};
  for (int v = 0; v < scene.old_mesh.node_slots() / 2; ++v)
    for (const auto& [tag, place] : places)
      if ((scene.old_mesh.rest(v) - place).norm() < 1e-9) scene.old_mesh.set_vertex_tag(v, tag);
  scene.coarsen(60, [](const EdgeKey&) { return true; });
  const History interpolated = scene.history;
  scene.transfer();
  int pins = 0;
  for (int v = 0; v < scene.mesh.node_slots(); ++v) {
    const int tag = scene.mesh.vertex_tag(v);
    if (tag == kNoTag) continue;
    ++pins;
    if (tag == 7) {
      EXPECT_EQ(scene.history.x[0][2 * v], interpolated.x[0][2 * v]);
    }
    EXPECT_EQ(scene.history.x[0][2 * v + 1], interpolated.x[0][2 * v + 1]) << "pin " << tag;
  }
  EXPECT_EQ(pins, 2);
  EXPECT_GT((scene.history.x[0] - interpolated.x[0]).norm(), 1e-3);
}

/// 1/2 ||xhat_old - xhat_new||^2, from the two meshes alone.
TEST(HistoryTransfer, LossIsTheDistanceOfThePredictors) {
  Scene scene(4);
  scene.bend();
  scene.coarsen(30, [](const EdgeKey&) { return true; });
  const auto report = scene.transfer();
  struct Arrays {
    std::vector<Vec<2>> rest;
    std::vector<std::array<int, 3>> cells;
    std::vector<double> density;
    std::vector<int> all;
    Arrays(const Mesh<2>& mesh, const std::map<int, Material>& materials) {
      for (int v = 0; v < mesh.node_slots(); ++v) rest.push_back(mesh.rest(v));
      for (int c = 0; c < mesh.cell_slots(); ++c) {
        cells.push_back(mesh.cell(c));
        density.push_back(materials.at(mesh.body(c)).density);
        all.push_back(c);
      }
    }
  };
  const Arrays from(scene.old_mesh, scene.setup.materials), to(scene.mesh, scene.setup.materials);
  const TimeIntegrator integrator(scene.setup.time);
  const auto rows = [](const VectorX& field, int n) {
    MatrixX result(n, 2);
    for (int v = 0; v < n; ++v) result.row(v) = field.segment<2>(2 * v).transpose();
    return result;
  };
  const VectorX squares =
      touched_difference<2>({from.rest, from.cells, from.density}, {to.rest, to.cells, to.density}, {from.all, to.all},
                            rows(integrator.predictor(scene.old_history), scene.old_mesh.node_slots()),
                            rows(integrator.predictor(scene.history), scene.mesh.node_slots()))
          .squares;
  EXPECT_GT(report.loss, 1e-6);
  EXPECT_NEAR(report.loss, squares.sum() / 2, 1e-10 * report.loss);
}

/// In 3D, a plate right below a body whose lower side is wavy.
TEST(HistoryTransfer, ForcedBarrierIn3D) {
  constexpr double kDensity = 3;
  linear::Registry registry;
  const auto solver = registry.create("eigen:llt");
  const auto integral = [](const Mesh<3>& mesh, const VectorX& u) {
    Vec<3> sum = Vec<3>::Zero();
    for (int c = 0; c < mesh.cell_slots(); ++c)
      for (const int v : mesh.cell(c)) sum += kDensity * mesh.volume(c) / 4 * u.segment<3>(3 * v);
    return sum;
  };
  for (unsigned seed = 0; seed < 3; ++seed) {
    std::mt19937 random(seed);
    const Mesh<3> old_mesh = make_cube(5, random, 0.15);
    itr::Setup<3> setup;
    setup.materials[1] = {.youngs_modulus = 1e5, .density = kDensity};
    setup.contact = {.enabled = true, .dhat = 1e-2};
    setup.time = {.dt = 0.01};
    const int n = old_mesh.node_slots();
    VectorX x(3 * (n + 3)), rates = VectorX::Random(x.size());
    double lowest = 1;
    for (int v = 0; v < n; ++v) {
      const Vec<3> X = old_mesh.rest(v);
      const double wave = std::sin(17 * X[0] + seed) * std::cos(13 * X[1]) * std::exp(-3 * X[2]);
      x.segment<3>(3 * v) = X + Vec<3>(0, 0, (X[2] > 0.1 ? 0.06 : 0.03) * wave);
      lowest = std::min(lowest, x[3 * v + 2]);
    }
    const double z = lowest - 1e-7;
    setup.obstacles.rest = {{-5, -5, z}, {9, -5, z}, {-5, 9, z}};
    setup.obstacles.triangles = {{0, 1, 2}};
    for (int o = 0; o < 3; ++o) x.segment<3>(3 * (n + o)) = setup.obstacles.rest[o];

    Mesh<3> mesh = old_mesh;
    int done = 0;
    for (int i = 0; i < 4000 && done < 12; ++i) {  // above the lower side: what interpolation carries along stays there
      const VertexId gone = static_cast<int>(random() % n);
      if (!mesh.is_vertex_alive(gone) || mesh.is_boundary(gone) || mesh.rest(gone)[2] > 0.5) continue;
      const auto around = mesh.cells_of(gone);
      const VertexId kept = mesh.cell(around[random() % around.size()])[random() % 4];
      const auto edit = kept == gone ? std::nullopt : collapse(mesh, gone, kept);
      if (!edit) continue;
      Mesh<3> changed = mesh;
      changed.apply(*edit);
      if (find_inverted<3>(changed, x.head(3 * n)) != kNone) continue;
      mesh = std::move(changed);
      ++done;
    }
    ASSERT_EQ(done, 12);
    TouchedCells touched;
    for (int c = 0; c < old_mesh.cell_slots(); ++c)
      if (!mesh.is_cell_alive(c)) touched.old_cells.push_back(c);
    const auto map = mesh.compact();
    for (int c = old_mesh.cell_slots(); c < static_cast<int>(map.cell.size()); ++c)
      if (map.cell[c] != kNone) touched.new_cells.push_back(map.cell[c]);
    const auto carried = [&](const VectorX& field) {
      VectorX kept(3 * (mesh.node_slots() + 3));
      for (int v = 0; v < n; ++v)
        if (map.vertex[v] != kNone) kept.segment<3>(3 * map.vertex[v]) = field.segment<3>(3 * v);
      kept.tail<9>() = field.tail<9>();
      return kept;
    };
    const History old_history{.x = {x}, .v = {rates}, .a = {}};
    History history{.x = {carried(x)}, .v = {carried(rates)}, .a = {}};
    const auto report = transfer_history(setup, old_mesh, old_history, mesh, touched, *solver, history);
    EXPECT_EQ(report.with_barriers, 1) << seed;
    EXPECT_EQ(report.not_converged, 0) << seed;
    EXPECT_LE((integral(mesh, history.x[0]) - integral(old_mesh, x)).norm(), kRoundOff * kDensity);
    EXPECT_LE((integral(mesh, history.v[0]) - integral(old_mesh, rates)).norm(), kRoundOff * kDensity);
    EXPECT_EQ(find_inverted<3>(mesh, history.x[0].head(3 * mesh.node_slots())), kNone);
    EXPECT_FALSE(has_intersection<3>(collision_surface(mesh, setup.obstacles), history.x[0])) << seed;
  }
}

}  // namespace
}  // namespace itr
