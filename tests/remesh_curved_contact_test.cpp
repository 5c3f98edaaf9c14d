// SPDX-License-Identifier: MIT
// Curved edges of surfaces in contact: patches see the chords that the whole mesh sees, the gate covers what chords sweep
// over, and random edits and whole runs intersect nothing.
#include <gtest/gtest.h>

#include <map>
#include <numeric>
#include <random>

#include "apply_edit.hpp"
#include "core/parallel.hpp"
#include "curved_mesh.hpp"
#include "curved_run.hpp"
#include "curved_trial.hpp"
#include "mesh/validate.hpp"
#include "random_mesh.hpp"
#include "remesh/curved_cell.hpp"
#include "remesh/decide/patch.hpp"
#include "remesh/decide/queries.hpp"
#include "remesh/remesher.hpp"
#include "simulation/contact_surface.hpp"
#include "simulation/invariants.hpp"
#include "simulation/patch_surface.hpp"
#include "simulation/state.hpp"
#include "tet_scene.hpp"

namespace itr {
namespace {

template <typename T>
class CurvedContact : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(CurvedContact, Dimensions);

auto straight_scene(unsigned seed, std::integral_constant<int, 2>) {
  return TrialScene(seed, 3, {.second_body = seed % 2 == 1, .moving_obstacle = seed % 3 == 0});
}
auto straight_scene(unsigned seed, std::integral_constant<int, 3>) { return TetScene(seed, 2); }

/// A random scene in contact, a fraction of its edges curved; not all are valid.
template <int Dim>
struct Scene {
  decltype(straight_scene(0, std::integral_constant<int, Dim>())) base;
  Mesh<Dim>& mesh = base.mesh;
  RemeshFields<Dim>& fields = base.fields;
  StepContext<Dim>& context = base.context;
  std::mt19937& random = base.random;
  Strata<Dim> strata;

  explicit Scene(unsigned seed, double fraction, double noise)
      : base(straight_scene(seed, std::integral_constant<int, Dim>())) {
    mesh.compact();
    strata = Strata<Dim>(mesh);
    std::uniform_real_distribution<double> off(-noise, noise);
    for (const EdgeKey& edge : mesh.edges()) {
      if (std::uniform_real_distribution<double>(0, 1)(random) >= fraction) continue;
      const VertexId node = mesh.add_node(edge);
      strata.add_nodes(1);
      fields.for_each([&](VectorX& field) {
        field.conservativeResize(Dim * (node + 1));
        field.segment<Dim>(Dim * node) = (field.segment<Dim>(Dim * edge[0]) + field.segment<Dim>(Dim * edge[1])) / 2;
        for (int k = 0; k < Dim; ++k) field[Dim * node + k] += off(random);
      });
    }
  }
  Scene(const Scene&) = delete;

  EdgeKey edge(bool of_surface) {
    const auto edges = mesh.edges();
    for (;;)
      if (const EdgeKey& edge = edges[random() % edges.size()]; !of_surface || !mesh.facets_of_edge(edge).empty())
        return edge;
  }
  Edit<Dim> edit(bool of_surface) {
    const EdgeKey e = edge(of_surface);
    const bool is_curved = mesh.node_of(e[0], e[1]) != kNone;
    if (random() % 2) return make_split(mesh, e);
    if (is_curved && random() % 2) return make_chords(mesh, e);
    return is_curved ? make_straighten(mesh, e) : make_curve(mesh, e);
  }
  void apply(const Edit<Dim>& edit) { apply_edit(edit, mesh, fields, strata); }
};

template <int Dim>
Obstacles<Dim> obstacles_of(const Scene<Dim>& scene) {
  const auto& from = scene.context.obstacles;
  return {.rest = from.rest, .edges = from.edges, .triangles = from.triangles, .motion = {}, .motions = {}};
}

/// All terms on the whole mesh, contact between the chords of the step's own surface.
template <int Dim>
double whole_energy(const Scene<Dim>& scene) {
  const Compact<Dim> compact(scene.mesh);
  const auto& obstacles = scene.context.obstacles;
  const CellSet<Dim> cells = whole_mesh(compact.mesh, obstacles.rest);
  const CollisionSurface surface = collision_surface(compact.mesh, obstacles_of(scene));
  const VectorX x = compact.field(scene.fields.x, obstacles.x);
  const VectorX predictor = compact.field(scene.fields.predictor, obstacles.x);
  const VectorX reference = compact.field(scene.fields.velocity_reference, obstacles.velocity_reference);
  IncrementalPotential<Dim> potential(scene.context, cells, {.predictor = predictor, .velocity_reference = reference});
  potential.add_contact(surface, scene.context.contact.barrier_stiffness);
  Workspace workspace;
  return potential.sum(potential.lag(x, workspace)).value(x, workspace);
}

/// Whether no chords meet, no obstacle is inside, and no cell is inverted, in a configuration.
template <int Dim>
std::string violation(const Scene<Dim>& scene, const VectorX& x, const std::vector<Vec<Dim>>& of_obstacles) {
  const Compact<Dim> compact(scene.mesh);
  StepSetup<Dim> setup;
  setup.contact.enabled = true;
  setup.obstacles = obstacles_of(scene);
  return find_violation(setup, compact.mesh, compact.field(x, of_obstacles));
}

template <int Dim>
bool is_valid(const Scene<Dim>& scene) {
  const auto& obstacles = scene.context.obstacles;
  if (!violation(scene, scene.fields.x, obstacles.x).empty()) return false;
  for (std::size_t i = 0; i < scene.fields.past_positions.size(); ++i)
    if (!violation(scene, scene.fields.past_positions[i], obstacles.past_x[i]).empty()) return false;
  return true;
}

TYPED_TEST(CurvedContact, PatchesSeeWhatTheWholeMeshSees) {
  constexpr int Dim = TypeParam::value;
  int compared = 0, in_contact = 0, moved_nodes = 0;
  std::map<typename Edit<Dim>::Kind, int> kinds;
  for (unsigned seed = 0; seed < 60; ++seed) {
    Scene<Dim> scene(seed, 0.1 * (seed % 8), 0.004);
    scene.context.contact.friction_coefficient = seed % 2 ? 0 : 0.3;
    if (!is_valid(scene)) continue;
    for (int i = 0; i < 6; ++i) {
      SCOPED_TRACE(::testing::Message() << "seed " << seed << ", edit " << i);
      const Edit<Dim> edit = scene.edit(i % 3 > 0);
      View<Dim> view(scene, scene.context, HistoryRule::interpolated);
      if (!view.gate.passes(edit, view.scratch.gate)) continue;
      const double before = whole_energy(scene);
      if (!std::isfinite(before)) break;
      Marks marks;
      const auto patch = select_patch<Dim>(scene.mesh, edit, {.rings = 1 + i % 3}, marks);
      LocalProblem<Dim> old_side(view.state, patch, edit, false, view.scratch),
          new_side(view.state, patch, edit, true, view.scratch);
      const double start = old_side.value(), unrelaxed = new_side.value();
      const bool relaxes = seed % 2 && new_side.has_unknowns();  // friction is lagged where a relaxation starts
      const double relaxed = relaxes ? new_side.relax(4).energy : unrelaxed;
      std::vector<typename LocalProblem<Dim>::Position> positions;
      if (relaxes) new_side.get_positions(positions);
      in_contact += old_side.touches_contact() && !edit.inserted_facets.empty();
      scene.apply(edit);
      EXPECT_NEAR(before - whole_energy(scene), start - unrelaxed, 1e-11 * std::abs(before) + 1e-13);
      const VertexId first_node = scene.mesh.node_slots() - static_cast<int>(edit.inserted_nodes.size());
      for (const auto& [v, x] : positions) {
        const VertexId slot = v == kNewVertex         ? first_node - 1
                              : v > kNewVertex - 1000 ? first_node + (kNewVertex - 1 - v)
                                                      : v;
        scene.fields.x.template segment<Dim>(Dim * slot) = x;
        if (const EdgeKey e = scene.mesh.edge_of_node(slot); e[0] != kNone)
          moved_nodes += !scene.mesh.facets_of_edge(e).empty();
      }
      EXPECT_NEAR(before - whole_energy(scene), start - relaxed, 1e-10 * std::abs(before) + 1e-13);
      EXPECT_EQ(violation(scene, scene.fields.x, scene.context.obstacles.x), "");
      ++compared;
      ++kinds[edit.kind];
    }
  }
  EXPECT_GT(compared, 100);
  EXPECT_GT(in_contact, 30);
  EXPECT_GT(moved_nodes, 30);
  EXPECT_EQ(kinds.size(), 4u);
}

/// Where a reach leaves contact out for less room, nothing comes nearer than dhat there; else it is as ever.
TYPED_TEST(CurvedContact, NothingTouchesInTheRoomThatAReachGivesWayTo) {
  constexpr int Dim = TypeParam::value;
  int gave_way = 0, kept = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    Scene<Dim> scene(seed, 0.4, 0.002);
    if (!is_valid(scene)) continue;
    scene.context.contact.dhat *= 0.02 * (1 + seed % 40);
    View<Dim> view(scene, scene.context, HistoryRule::interpolated);
    const SurfaceIndex<Dim>& surface = view.state.surface;
    const double dhat = scene.context.contact.dhat;
    for (VertexId v = 0; v < scene.mesh.node_slots(); ++v) {
      if (!scene.mesh.is_vertex_alive(v) || !scene.mesh.is_boundary(v)) continue;
      ContactReach<Dim> usual, yielding;
      for (auto* reach : {&usual, &yielding}) {
        reach->clear(scene.mesh.facet_slots());
        for (const FacetId f : scene.mesh.facets_of(v))
          for (const auto& piece : surface.pieces(f)) reach->add(piece, f, true);
        reach->find(surface, view.scratch.neighbourhoods, dhat, view.scratch.hits, reach == &yielding,
                    [](FacetId) { return false; });
      }
      if (usual.touching().empty() || !yielding.touching().empty()) {
        EXPECT_EQ(yielding.touching(), usual.touching());
        EXPECT_EQ(yielding.room(), usual.room());
        ++kept;
        continue;
      }
      ++gave_way;
      const auto facets = scene.mesh.facets_of(v);
      const auto check = [&](const SurfacePiece<Dim>& other, bool moves) {
        const double reach = dhat + (1 + moves) * yielding.room();
        for (const FacetId f : facets)
          for (const auto& piece : surface.pieces(f))
            EXPECT_GE(distance_below(piece, other, 2 * reach), (1 - 1e-12) * reach) << "seed " << seed;
      };
      for (FacetId f = 0; f < scene.mesh.facet_slots(); ++f)
        for (const auto& piece : surface.pieces(f)) check(piece, std::find(facets.begin(), facets.end(), f) != facets.end());
      for (int i = 0; i < static_cast<int>(surface.primitives().all.size()); ++i) check(surface.obstacle_piece(i), false);
    }
  }
  EXPECT_GT(gave_way, 20);
  EXPECT_GT(kept, 20);
}

/// Adds obstacle points near the surface, outside of bodies.
template <int Dim>
void scatter_points(Scene<Dim>& scene, int count) {
  auto& obstacles = scene.context.obstacles;
  const Compact<Dim> compact(scene.mesh);
  const auto now = body_boundary(compact.mesh, compact.field(scene.fields.x, {}));
  const auto past = body_boundary(compact.mesh, compact.field(scene.fields.past_positions[0], {}));
  const auto is_outside = [](const ClosedSurface<Dim>& boundary, const Vec<Dim>& point) {
    return !boundary.touches(point) && boundary.winding(point) == 0;
  };
  std::normal_distribution<double> off(0, 0.02);
  std::uniform_real_distribution<double> part(0, 1);
  for (int i = 0; i < count; ++i) {
    const EdgeKey edge = scene.edge(true);
    const VertexId node = scene.mesh.node_of(edge[0], edge[1]);
    const double t = part(scene.random);
    const VectorX& x = scene.fields.x;
    Vec<Dim> point =
        (1 - t) * vertex_of<Dim>(x, edge[i % 2]) + t * vertex_of<Dim>(x, node == kNone ? edge[1 - i % 2] : node);
    for (int k = 0; k < Dim; ++k) point[k] += off(scene.random);
    if (!is_outside(now, point) || !is_outside(past, point)) continue;
    for (auto* points : {&obstacles.rest, &obstacles.x, &obstacles.velocity_reference}) points->push_back(point);
    obstacles.past_x[0].push_back(point);
  }
}

/// With obstacle points around the surface, many between where chords are and where they would be.
TYPED_TEST(CurvedContact, WhatTheGateLetsPassIntersectsNothing) {
  constexpr int Dim = TypeParam::value;
  int passed = 0, refused = 0;
  for (unsigned seed = 0; seed < (Dim == 2 ? 120 : 60); ++seed) {
    Scene<Dim> scene(seed, 0.5, Dim == 2 ? 0.03 : 0.02);
    if (!is_valid(scene)) continue;
    scatter_points(scene, 300);
    ASSERT_TRUE(is_valid(scene)) << "seed " << seed;
    for (int i = 0; i < 25; ++i) {
      const Edit<Dim> edit = scene.edit(true);
      View<Dim> view(scene, scene.context, HistoryRule::interpolated);
      if (!view.gate.passes(edit, view.scratch.gate)) {
        ++refused;
        continue;
      }
      ++passed;
      scene.apply(edit);
      ASSERT_TRUE(is_valid(scene)) << "seed " << seed << ", edit " << i;
    }
  }
  EXPECT_GT(passed, 200);
  EXPECT_GT(refused, 50);
}

/// A prediction reports the box of the surface that it has read. Vertices that move outside of this box do not change it by
/// a bit: else results would depend on how many threads look at edges beside edits that move the surface.
TYPED_TEST(CurvedContact, PredictionsSayWhatTheyReadOfTheSurface) {
  constexpr int Dim = TypeParam::value;
  int compared = 0, read = 0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    Scene<Dim> scene(seed, 0.5, Dim == 2 ? 0.01 : 0.006);
    if (!is_valid(scene)) continue;
    const std::size_t first = scene.context.obstacles.x.size();  // those before are of edges, which are long
    scatter_points(scene, 200);
    for (auto& [body, material] : scene.context.materials)  // so that local solves predict
      material.youngs_modulus_at = [](const Vec<3>& X) { return 100 * (1 + 0.1 * X[0]); };
    RemeshOptions options;
    options.curve.enabled = true;
    options.split.acceptance_tolerance = 1;
    options.split.min_edge_length = 0;
    for (int i = 0; i < 10; ++i) {
      const EdgeKey edge = scene.edge(true);
      const bool is_curved = scene.mesh.node_of(edge[0], edge[1]) != kNone;
      const auto predict = [&](Box<Dim>& box) {
        const Gate<Dim> gate(scene.mesh, scene.fields, scene.context);
        const RemeshQueries<Dim> queries(scene.mesh, scene.fields, scene.context, options, scene.strata, gate, nullptr,
                                         nullptr);
        LocalScratch<Dim> scratch;
        return is_curved ? queries.predict_split(edge, scratch, &box) : queries.predict_curve(edge, scratch, &box);
      };
      Box<Dim> box, other;
      const double predicted = predict(box);
      auto& points = scene.context.obstacles.x;
      const std::vector<Vec<Dim>> kept = points;
      const auto move = [&](const auto& may_move) {
        for (std::size_t o = first; o < points.size(); ++o)
          if (may_move(points[o])) points[o] += Vec<Dim>::Constant(1e-4);
      };
      move([&](const Vec<Dim>& point) { return !box.inflated(1e-3).contains(point); });
      EXPECT_EQ(predict(other), predicted) << "seed " << seed << ", edge " << i;
      points = kept;
      move([](const Vec<Dim>&) { return true; });
      read += predict(other) != predicted;
      points = kept;
      ++compared;
    }
  }
  EXPECT_GT(compared, 100);
  EXPECT_GT(read, 20);
}

/// With a reach that finds everything, a projection's surface is that of the step.
TYPED_TEST(CurvedContact, ProjectionsSeeTheChordsOfTheWholeSurface) {
  constexpr int Dim = TypeParam::value;
  for (unsigned seed = 0; seed < 10; ++seed) {
    const Scene<Dim> scene(seed, 0.5, 0.004);
    const Compact<Dim> compact(scene.mesh);
    const auto& [mesh, slots] = compact;
    const Obstacles<Dim> obstacles = obstacles_of(scene);
    const VectorX x = compact.field(scene.fields.x, scene.context.obstacles.x);
    const TouchedCells touched{.old_cells = {}, .new_cells = {0, 1, 2, 3}};
    const auto patch = make_transfer_patch<Dim>(mesh, mesh, touched, scene.context.materials, 0);
    const auto& ids = patch.new_cells.vertices;
    std::vector<char> moving(ids.size());
    VectorX goal(Dim * static_cast<Eigen::Index>(ids.size()));
    for (std::size_t i = 0; i < ids.size(); ++i) {
      moving[i] = !patch.at_rim[i];
      vertex_of<Dim>(goal, static_cast<int>(i)) = vertex_of<Dim>(x, ids[i]);
    }
    const auto found = patch_surface<Dim>(mesh, obstacles, patch, moving, x, goal, 100, 0);
    if (found.empty()) continue;
    const CollisionSurface whole = collision_surface(mesh, obstacles);
    const auto id = [&](int v) {
      const auto n = static_cast<int>(ids.size());
      return v < n ? ids[v] : found.others[v - n];
    };
    std::map<int, double> area, whole_area;
    for (const int v : found.surface.vertices) area[id(v)] = found.surface.area[v];
    for (const int v : whole.vertices) whole_area[v] = whole.area[v];
    ASSERT_EQ(area.size(), whole_area.size());
    for (const auto& [v, a] : whole_area) EXPECT_NEAR(area.at(v), a, 1e-13) << v;
    EXPECT_EQ(found.surface.edges.size(), whole.edges.size());
    EXPECT_EQ(found.surface.triangles.size(), whole.triangles.size());
  }
}

/// A unit square, its upper edge curved up by 0.1.
struct Bulge {
  Mesh<2> mesh;
  RemeshFields<2> fields;
  StepContext<2> context;
  EdgeKey top{2, 3};
  explicit Bulge(double height, const Vec<2>& point) {
    mesh = Mesh<2>({{0, 0}, {1, 0}, {0, 1}, {1, 1}}, {{0, 1, 2}, {1, 3, 2}}, {1, 1});
    mesh.add_node(top);
    fields.x.resize(10);
    for (int v = 0; v < 5; ++v) vertex_of<2>(fields.x, v) = mesh.rest(v);
    fields.x[9] += height;
    fields.past_positions = {fields.x};
    context.contact.enabled = true;
    context.contact.dhat = 1e-3;
    context.materials[1] = {};
    auto& obstacles = context.obstacles;
    obstacles.rest = obstacles.x = {point};
    obstacles.past_x = {{Vec<2>(5, 5)}};
  }
  bool passes(const Edit<2>& edit) const {
    GateScratch<2> scratch;
    return Gate<2>(mesh, fields, context).passes(edit, scratch);
  }
};

TEST(CurvedGate, CoversWhatTheSplitOfACurvedEdgeSweeps) {
  for (const auto& [point, is_free] :
       {std::pair(Vec<2>(0.25, 1.06), false), std::pair(Vec<2>(0.25, 1.08), true), std::pair(Vec<2>(0.5, 1.11), true)}) {
    Bulge bulge(0.1, point);
    EXPECT_EQ(bulge.passes(make_split(bulge.mesh, bulge.top)), is_free) << point.transpose();
    std::swap(bulge.context.obstacles.x[0], bulge.context.obstacles.past_x[0][0]);  // the same in a past configuration
    EXPECT_EQ(bulge.passes(make_split(bulge.mesh, bulge.top)), is_free) << point.transpose();
  }
}

TEST(CurvedGate, CoversWhatStraighteningSweeps) {
  for (const auto& [point, is_free] : {std::pair(Vec<2>(0.5, 0.95), false), std::pair(Vec<2>(0.5, 1.01), true)}) {
    const Bulge bulge(-0.1, point);
    EXPECT_EQ(bulge.passes(make_straighten(bulge.mesh, bulge.top)), is_free) << point.transpose();
  }
}

TEST(CurvedGate, LetsChordsReplaceTheirCurveBesideAnything) {
  const Bulge bulge(0.1, Vec<2>(0.25, 1.06));  // between a chord and the curve
  EXPECT_TRUE(bulge.passes(make_chords(bulge.mesh, bulge.top)));
  EXPECT_FALSE(Bulge(0.1, Vec<2>(0.25, 1.04)).passes(make_straighten(bulge.mesh, bulge.top)));
}

/// A bar that is pressed onto obstacles.
template <int Dim>
Setup<Dim> pressed_bar() {
  Setup<Dim> setup = make_bar<Dim>(10);
  if constexpr (Dim == 2) {
    setup.obstacles.rest = {{1.6, -0.4}, {2.1, -0.03}, {2.6, -0.4}, {-1, -0.5}, {5, -0.5}};
    setup.obstacles.edges = {{0, 1}, {1, 2}, {3, 4}};
  } else {
    setup.obstacles.rest = {{1.5, -0.4, -1}, {2.2, -0.03, -1}, {2.9, -0.4, -1},
                            {1.5, -0.4, 3},  {2.1, -0.03, 3},  {2.9, -0.4, 3}};
    setup.obstacles.triangles = {{0, 1, 4}, {0, 4, 3}, {1, 2, 5}, {1, 5, 4}};
    setup.obstacles.edges = {{0, 1}, {1, 4}, {0, 4}, {4, 3}, {0, 3}, {1, 2}, {2, 5}, {1, 5}, {4, 5}};
  }
  setup.obstacles.motion.assign(setup.obstacles.rest.size(), kNone);
  setup.time.dt = 0.05;
  setup.time.steps = Dim == 2 ? 8 : 6;
  setup.contact.enabled = true;
  setup.contact.dhat = 0.01;
  setup.contact.convergent = true;
  setup.contact.barrier_stiffness = 1e5;
  setup.contact.adaptive_stiffness = false;
  setup.contact.friction_coefficient = 0.2;
  setup.remesh.enabled = true;
  setup.remesh.split.acceptance_tolerance = Dim == 2 ? 2 : 20;
  setup.remesh.curve.enabled = setup.remesh.straighten.enabled = true;
  setup.remesh.straighten.acceptance_tolerance = -0.05;
  setup.remesh.collapse.rel_max_edge_length = 2;
  setup.remesh.swap.enabled = setup.remesh.smooth.enabled = true;
  return setup;
}

TYPED_TEST(CurvedContact, RunsStayValidOnAnyNumberOfThreads) {
  constexpr int Dim = TypeParam::value;
  const Setup<Dim> setup = pressed_bar<Dim>();
  const Run<Dim> first = run<Dim>(setup);
  EXPECT_LT(first.nearest, 0.01);
  EXPECT_GT(first.splits, 5);
  EXPECT_GT(first.curves, 5);
  EXPECT_GT(first.straightens + first.collapses, 0);
  EXPECT_GT(first.of_surface, 20);
  for (const int threads : {1, 3}) {
    const ThreadLimit limit(threads);
    const State<Dim> again = run<Dim>(setup).state;
    expect_same(again, first.state);
  }
}

/// How deep samples of the curves of a state are in the tent of pressed_bar [m].
double depth_in_tent(const State<2>& state) {
  const VectorX& x = state.history.x[0];
  double deepest = 0;
  for (const EdgeKey& edge : state.mesh.curved_edges()) {
    if (state.mesh.facets_of_edge(edge).empty()) continue;
    for (double t = 0; t <= 1; t += 1.0 / 64) {
      const Vec<2> p = (1 - t) * (1 - 2 * t) * vertex_of<2>(x, edge[0]) + t * (2 * t - 1) * vertex_of<2>(x, edge[1]) +
                       4 * t * (1 - t) * vertex_of<2>(x, state.mesh.node_of(edge));
      const double roof = p[0] < 2.1 ? -0.4 + 0.74 * (p[0] - 1.6) : -0.4 + 0.74 * (2.6 - p[0]);
      if (p[1] > -0.4) deepest = std::max(deepest, roof - p[1]);
    }
  }
  return deepest;
}

TEST(CurvedSurface, OfARunOverlapsNothing) {
  itr::Setup<2> setup = pressed_bar<2>();
  setup.contact.dhat = 1e-3;
  setup.contact.barrier_stiffness = 1e6;
  setup.choose_defaults();
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  double deepest = 0;
  while (!simulation.finished()) {
    ASSERT_TRUE(simulation.advance().ok);
    deepest = std::max(deepest, depth_in_tent(simulation.state()));
  }
  EXPECT_EQ(deepest, 0);
}

/// A scene of order 2, its surface curved from the start.
TYPED_TEST(CurvedContact, RunsOfOrderTwoSplit) {
  constexpr int Dim = TypeParam::value;
  Setup<Dim> setup = pressed_bar<Dim>();
  setup.order[1] = 2;
  setup.remesh.curve.enabled = setup.remesh.straighten.enabled = false;
  setup.remesh.split.acceptance_tolerance = Dim == 2 ? 1 : 5;
  setup.time.steps = 4;
  const Run<Dim> result = run<Dim>(setup);
  EXPECT_LT(result.nearest, 0.01);
  EXPECT_GT(result.splits, 3);
  EXPECT_TRUE(is_all_curved(result.state.mesh));
}

}  // namespace
}  // namespace itr
