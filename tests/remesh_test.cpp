// SPDX-License-Identifier: MIT
// Edits and trials on random meshes: what they conserve, and that a patch sees exactly what the whole mesh would see.
#include <gtest/gtest.h>

#include <map>
#include <random>

#include "itr/energy/contact/contact.hpp"
#include "itr/mesh/validate.hpp"
#include "itr/remesh/edits.hpp"
#include "itr/remesh/local_problem.hpp"
#include "itr/remesh/patch.hpp"
#include "itr/remesh/remesher.hpp"

namespace itr {
namespace {

/// A unit square of n x n perturbed quadrilaterals with random diagonals; body 1 left of the middle, body 2 right of it;
/// facet tags 1 to 4 by side.
Mesh<2> random_mesh(int n, std::mt19937& random) {
  std::uniform_real_distribution<double> noise(-0.25 / n, 0.25 / n);
  std::vector<Vec<2>> rest;
  std::vector<std::array<int, 3>> cells;
  std::vector<int> body;
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i) {
      const bool inside_x = i > 0 && i < n && 2 * i != n, inside_y = j > 0 && j < n;
      rest.emplace_back(double(i) / n + (inside_x && inside_y ? noise(random) : 0),
                        double(j) / n + (inside_y && inside_x ? noise(random) : 0));
    }
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const int a = j * (n + 1) + i, b = a + 1, c = a + n + 2, d = a + n + 1;
      const bool diagonal = random() % 2;
      cells.push_back(diagonal ? std::array{a, b, c} : std::array{a, b, d});
      cells.push_back(diagonal ? std::array{a, c, d} : std::array{b, c, d});
      body.insert(body.end(), 2, 2 * i < n ? 1 : 2);
    }
  Mesh<2> mesh(rest, cells, body);
  for (int f = 0; f < mesh.facet_slots(); ++f) {
    const Vec<2> m = 0.5 * (mesh.rest(mesh.facet(f)[0]) + mesh.rest(mesh.facet(f)[1]));
    mesh.set_facet_tag(f, m[0] < 1e-9 ? 1 : m[1] < 1e-9 ? 2 : m[0] > 1 - 1e-9 ? 3 : 4);
  }
  return mesh;
}

struct Totals {
  std::map<int, double> area, length;
  explicit Totals(const Mesh<2>& mesh) {
    for (int c = 0; c < mesh.cell_slots(); ++c)
      if (mesh.is_cell_alive(c)) area[mesh.body(c)] += mesh.volume(c);
    for (int f = 0; f < mesh.facet_slots(); ++f)
      if (mesh.is_facet_alive(f))
        length[mesh.facet_tag(f)] += (mesh.rest(mesh.facet(f)[1]) - mesh.rest(mesh.facet(f)[0])).norm();
  }
};

std::optional<Edit<2>> random_edit(const Mesh<2>& mesh, std::mt19937& random) {
  const auto edges = mesh.edges();
  const EdgeKey edge = edges[random() % edges.size()];
  switch (random() % 4) {
    case 0:
      return make_split(mesh, edge);
    case 1:
      return make_collapse(mesh, edge);
    case 2:
      return make_swap(mesh, edge);
    default:
      return make_move(mesh, edge[0], best_shaped_position(mesh, edge[0], 3));
  }
}

TEST(Edits, KeepAreasTagsInterfacesAndOrientation) {
  std::map<Edit<2>::Kind, int> done;
  for (unsigned seed = 0; seed < 10; ++seed) {
    std::mt19937 random(seed);
    Mesh<2> mesh = random_mesh(4, random);
    const Totals before(mesh);
    for (int i = 0; i < 150; ++i) {
      const auto edit = random_edit(mesh, random);
      if (!edit) continue;
      mesh.apply(*edit);
      ++done[edit->kind];
      ASSERT_EQ(mesh.find_defect(), "") << "seed " << seed << ", edit " << i;
    }
    mesh.compact();
    ASSERT_EQ(mesh.find_defect(), "");
    const Totals after(mesh);
    for (const auto& [body, area] : before.area) EXPECT_NEAR(after.area.at(body), area, 1e-13);
    for (const auto& [tag, length] : before.length) EXPECT_NEAR(after.length.at(tag), length, 1e-13);
  }
  EXPECT_EQ(done.size(), 4u);  // every kind was tried in earnest
  for (const auto& [kind, count] : done) EXPECT_GT(count, 20);
}

/// A body above an obstacle line, within dhat of it, with a random state.
struct TrialScene {
  std::mt19937 random;
  Mesh<2> mesh;
  RemeshFields<2> fields;
  StepContext<2> context;
  explicit TrialScene(unsigned seed) : random(seed), mesh(random_mesh(6, random)) {
    context.materials[1] = {.youngs_modulus = 10, .poisson_ratio = 0.3, .density = 2};
    context.materials[2] = {.youngs_modulus = 1000, .poisson_ratio = 0.4, .density = 5};
    context.scaling = 0.01;
    context.contact = {.enabled = true, .activation_distance = 0.03, .convergent = true, .barrier_stiffness = 5};
    context.newton.step_tolerance = 1e-9;
    context.shortest_edge = 0.1;
    context.loads.acceleration = [](const Vec<2>&) { return Vec<2>(0, -1); };
    context.loads.tractions.emplace_back(4, [](const Vec<2>& X) { return Vec<2>(X[0], 1); });
    auto& obstacles = context.obstacles;
    obstacles.rest = obstacles.x = obstacles.velocity_reference = {{-0.5, -0.03}, {0.4, -0.02}, {1.5, -0.03}};
    obstacles.edges = {{0, 1}, {1, 2}};
    obstacles.area = {0.45, 1, 0.55};
    obstacles.degree = {1, 2, 1};
    obstacles.past_x = {obstacles.x};
    std::uniform_real_distribution<double> noise(-0.008, 0.008);
    fields.x.resize(2 * mesh.vertex_slots());
    for (int v = 0; v < mesh.vertex_slots(); ++v)
      for (int c = 0; c < 2; ++c) fields.x[2 * v + c] = mesh.rest(v)[c] + noise(random);
    fields.predictor = fields.velocity_reference = fields.x;
    for (Eigen::Index i = 0; i < fields.x.size(); ++i) fields.predictor[i] += noise(random);
    fields.past_positions = {fields.predictor};
  }
};

/// All terms on the whole mesh, built without any patch.
double global_energy(const Mesh<2>& slots, const RemeshFields<2>& slot_fields, const StepContext<2>& context) {
  Mesh<2> mesh = slots;
  const auto map = mesh.compact();
  const int bodies = mesh.vertex_slots();
  const auto compacted = [&](const VectorX& field, const std::vector<Vec<2>>& extra) {
    VectorX kept(2 * (bodies + extra.size()));
    for (std::size_t v = 0; v < map.vertex.size(); ++v)
      if (map.vertex[v] != kNone) kept.segment<2>(2 * map.vertex[v]) = field.segment<2>(2 * v);
    for (std::size_t o = 0; o < extra.size(); ++o) kept.segment<2>(2 * (bodies + o)) = extra[o];
    return kept;
  };
  const VectorX x = compacted(slot_fields.x, context.obstacles.x);
  const CellSet<2> cells = whole_mesh(mesh, context.obstacles.rest);
  CollisionSurface surface;
  const int total = cells.num_vertices;
  surface.area.assign(total, 0);
  surface.degree.assign(total, 0);
  surface.counts.assign(total, 0);
  const auto add = [&](int a, int b) {
    surface.edges.push_back({std::min(a, b), std::max(a, b)});
    for (const int v : {a, b}) {
      surface.area[v] += (cells.rest[a] - cells.rest[b]).norm() / 2;
      ++surface.degree[v];
    }
  };
  for (const auto& facet : cells.facets) add(facet.vertices[0], facet.vertices[1]);
  for (int v = 0; v < total; ++v)
    if (surface.degree[v] > 0) surface.vertices.push_back(v), surface.counts[v] = 1;
  for (std::size_t o = 0; o < context.obstacles.x.size(); ++o) {
    surface.vertices.push_back(bodies + static_cast<int>(o));
    surface.area[bodies + o] = context.obstacles.area[o];
    surface.degree[bodies + o] = context.obstacles.degree[o];
  }
  for (const auto& [a, b] : context.obstacles.edges) surface.edges.push_back({bodies + a, bodies + b});
  std::sort(surface.edges.begin(), surface.edges.end());
  Workspace workspace;
  const VectorX predictor = compacted(slot_fields.predictor, context.obstacles.x);
  return InertiaEnergy<2>(cells, context.materials, MassKind::consistent, predictor).value(x, workspace) +
         ElasticEnergy<2>(cells, context.materials, context.scaling).value(x, workspace) +
         LoadEnergy<2>(cells, context.materials, context.loads, context.scaling).value(x, workspace) +
         ContactEnergy<2>(surface, context.contact, context.contact.barrier_stiffness, context.scaling).value(x, workspace);
}

TEST(LocalProblem, EnergyDifferenceOfAnEditEqualsTheGlobalOne) {
  int compared = 0, in_contact = 0;
  for (unsigned seed = 0; seed < 30; ++seed) {
    TrialScene scene(seed);
    const auto edit = random_edit(scene.mesh, scene.random);
    if (!edit) continue;
    LocalScratch scratch;
    Marks marks;
    SurfaceTree tree(scene.mesh, scene.fields, scene.context);
    const auto patch = select_patch(scene.mesh, edit->removed_cells, Vec<2>(0.5, 0.5), 1, {}, marks);
    LocalProblem before(scene.mesh, scene.fields, scene.context, patch, &*edit, false, HistoryRule::interpolated, tree,
                        scratch);
    LocalProblem after(scene.mesh, scene.fields, scene.context, patch, &*edit, true, HistoryRule::interpolated, tree,
                       scratch);
    const double local = after.value() - before.value();
    const double global_before = global_energy(scene.mesh, scene.fields, scene.context);
    Mesh<2> changed = scene.mesh;
    RemeshFields<2> fields = scene.fields;
    fields.follow(*edit, changed.apply(*edit));
    const double global_after = global_energy(changed, fields, scene.context);
    if (!std::isfinite(global_before) || !std::isfinite(global_after)) continue;  // inverted by the random state
    EXPECT_NEAR(local, global_after - global_before, 1e-12 * std::abs(global_before)) << "seed " << seed;
    ++compared;
    in_contact += before.touches_contact();
  }
  EXPECT_GT(compared, 15);
  EXPECT_GT(in_contact, 5);
}

TEST(LocalProblem, RelaxationLowersTheGlobalEnergyByWhatItReports) {
  for (unsigned seed = 100; seed < 110; ++seed) {
    TrialScene scene(seed);
    const auto edges = scene.mesh.edges();
    const auto edit = make_split(scene.mesh, edges[scene.random() % edges.size()]);
    LocalScratch scratch;
    Marks marks;
    SurfaceTree tree(scene.mesh, scene.fields, scene.context);
    const auto patch = select_patch(scene.mesh, edit.removed_cells, edit.value->rest, 1, {}, marks);
    LocalProblem after(scene.mesh, scene.fields, scene.context, patch, &edit, true, HistoryRule::function, tree, scratch);
    const double start = after.value(), end = after.relax(5).energy;
    Mesh<2> changed = scene.mesh;
    RemeshFields<2> fields = scene.fields;
    const VertexId created = changed.apply(edit);
    fields.follow(edit, created);
    const double global_start = global_energy(changed, fields, scene.context);
    after.write_back(fields.x, created);
    const double global_end = global_energy(changed, fields, scene.context);
    EXPECT_LT(end, start);
    EXPECT_NEAR(end - start, global_end - global_start, 1e-12 * std::abs(global_start)) << "seed " << seed;
  }
}

/// The part of x-hat that a coarser mesh cannot represent: inertia after a collapse equals the integral over the old mesh.
TEST(LocalProblem, HistoryAsAFunctionNeverGainsByForgetting) {
  int compared = 0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    TrialScene scene(seed);
    scene.fields.x = scene.fields.predictor;  // at rest with respect to the history: all inertia is loss
    const auto edges = scene.mesh.edges();
    const auto edit = make_collapse(scene.mesh, edges[scene.random() % edges.size()]);
    if (!edit) continue;
    LocalScratch scratch;
    Marks marks;
    SurfaceTree tree(scene.mesh, scene.fields, scene.context);
    const auto patch = select_patch(scene.mesh, edit->removed_cells, edit->value->rest, 1, {}, marks);
    const auto inertia = [&](HistoryRule rule) {
      LocalProblem after(scene.mesh, scene.fields, scene.context, patch, &*edit, true, rule, tree, scratch);
      return after.value();
    };
    const double kept = inertia(HistoryRule::function), forgotten = inertia(HistoryRule::interpolated);
    if (!std::isfinite(kept)) continue;  // inverted by the random state
    EXPECT_GT(kept - forgotten, 0) << "seed " << seed;
    ++compared;
  }
  EXPECT_GT(compared, 5);
}

TEST(Remesh, EveryRunIsDeterministicAndKeepsTheMeshValid) {
  const auto run = [](unsigned seed) {
    TrialScene scene(seed);
    RemeshOptions options;
    options.split.acceptance_tolerance = 1e-3;
    options.split.culling_threshold = 0.5;
    options.collapse.rel_max_edge_length = 100;
    options.collapse.culling_threshold = 0.5;
    options.collapse.acceptance_tolerance = -1e-3;
    options.swap.enabled = options.smooth.enabled = true;
    const Totals before(scene.mesh);
    const auto report = remesh(scene.mesh, scene.fields, scene.context, options);
    EXPECT_TRUE(report.changed());
    EXPECT_EQ(scene.mesh.find_defect(), "");
    EXPECT_EQ(find_inverted<2>(scene.mesh, scene.fields.x), kNone);
    const Totals after(scene.mesh);
    for (const auto& [body, area] : before.area) EXPECT_NEAR(after.area.at(body), area, 1e-13);
    for (const auto& [tag, length] : before.length) EXPECT_NEAR(after.length.at(tag), length, 1e-13);
    return scene.fields.x;
  };
  for (unsigned seed = 0; seed < 5; ++seed) {
    const VectorX first = run(seed), second = run(seed);
    EXPECT_TRUE(first.size() == second.size() && (first.array() == second.array()).all());
  }
}

}  // namespace
}  // namespace itr
