// SPDX-License-Identifier: MIT
// Trials and whole remeshing in 3D: a patch sees what the whole mesh sees, and the state stays valid.
#include <gtest/gtest.h>

#include <map>
#include <memory>
#include <random>

#include "core/parallel.hpp"
#include "fem/inverted.hpp"
#include "geometry/intersection.hpp"
#include "remesh/decide/patch.hpp"
#include "remesh/decide/prediction.hpp"
#include "remesh/decide/trial.hpp"
#include "remesh/remesher.hpp"
#include "remesh_options.hpp"
#include "tet_scene.hpp"

namespace itr {
namespace {

std::optional<Edit<3>> random_edit(const TetScene& scene, const Strata<3>& strata, std::mt19937& random) {
  const auto edges = scene.mesh.edges();
  const EdgeKey edge = edges[random() % edges.size()];
  switch (random() % 4) {
    case 0:
      return make_split(scene.mesh, edge);
    case 1:
      return propose_collapse(scene.mesh, strata, edge).edit;
    case 2:
      return propose_edge_removal(scene.mesh, strata, edge, shape_cost(scene.mesh)).edit;
    default:
      return propose_move<3>(scene.mesh, strata, edge[0], scene.mesh.rest(edge[0]) + Vec<3>(0.01, -0.02, 0.01)).edit;
  }
}

/// Data that a patch's test compares: the scene, the patch around a random edit that passes the gate, and both meshes.
struct EditedScene {
  const TetScene& scene;
  LocalProblem<3>& before;
  LocalProblem<3>& after;
  double energy;  ///< of the whole mesh before
  const Mesh<3>& changed;
  RemeshFields<3>& fields;  ///< after
  VertexId created;
};

/// Gives `compare` random edits of random scenes until it has taken `count` of them.
template <typename Compare>
void for_random_edits(int count, int edits_a_scene, double friction, const Compare& compare) {
  int compared = 0;
  for (unsigned seed = 0; compared < count && !::testing::Test::HasFailure(); ++seed) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed);
    TetScene scene(seed);
    scene.context.contact.friction_coefficient = friction;
    if (find_inverted<3>(scene.mesh, scene.fields.x) != kNone) continue;
    const double energy = whole_energy(scene.mesh, scene.fields, scene.context);
    if (!std::isfinite(energy)) continue;
    const Strata<3> strata(scene.mesh);
    const Gate<3> gate(scene.mesh, scene.fields, scene.context);
    const RemeshState<3> state{scene.mesh, scene.fields, scene.context, gate.present(), HistoryRule::interpolated};
    LocalScratch<3> scratch;
    Marks marks;
    for (int i = 0; i < edits_a_scene; ++i) {
      const auto edit = random_edit(scene, strata, scene.random);
      if (!edit || !gate.passes(*edit, scratch.gate)) continue;
      const auto patch = select_patch<3>(scene.mesh, *edit, {}, marks);
      LocalProblem<3> before(state, patch, *edit, false, scratch), after(state, patch, *edit, true, scratch);
      Mesh<3> changed = scene.mesh;
      RemeshFields<3> fields = scene.fields;
      const VertexId created = changed.apply(*edit);
      fields.follow(*edit, created);
      compared += compare(EditedScene{scene, before, after, energy, changed, fields, created});
    }
  }
}

TEST(LocalProblem3d, EnergyDifferenceOfAnEditEqualsTheGlobalOne) {
  int in_contact = 0;
  for_random_edits(150, 10, 0.2, [&](const EditedScene& s) {
    const double global = whole_energy(s.changed, s.fields, s.scene.context) - s.energy;
    EXPECT_NEAR(s.after.value() - s.before.value(), global, 1e-11 * s.energy);
    in_contact += s.before.touches_contact();
    return true;
  });
  EXPECT_GT(in_contact, 10);
}

TEST(LocalProblem3d, RelaxationLowersTheGlobalEnergyByWhatItReports) {
  int in_contact = 0, clear = 0;
  for_random_edits(60, 5, 0, [&](const EditedScene& s) {  // friction is lagged where a relaxation starts
    if (!s.after.has_unknowns()) return false;
    const double unrelaxed = whole_energy(s.changed, s.fields, s.scene.context), local = s.after.value();
    const double fall = local - s.after.relax(20).energy;
    std::vector<LocalProblem<3>::Position> positions;
    s.after.get_positions(positions);
    for (const auto& [v, x] : positions) s.fields.x.segment<3>(3 * (v == kNewVertex ? s.created : v)) = x;
    EXPECT_NEAR(fall, unrelaxed - whole_energy(s.changed, s.fields, s.scene.context), 1e-10 * s.energy);
    ++(s.after.touches_contact() ? in_contact : clear);
    return true;
  });
  EXPECT_GT(in_contact, 10);
  EXPECT_GT(clear, 10);
}

TEST(ContactReach3d, DistancesOfPiecesAreThoseOfAllTheirPrimitives) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0, 1);
  const auto point = [&] { return Vec<3>(uniform(random), uniform(random), uniform(random)); };
  int near = 0;
  for (int i = 0; i < 3000; ++i) {
    SurfacePiece<3> a, b;
    const int shared = i % 3;
    for (int k = 0; k < 3; ++k) a.add(point(), k);
    for (int k = 0; k < 3; ++k) b.add(k < shared ? a.p[2 - k] : point(), k < shared ? 2 - k : 10 + k);
    double least = std::numeric_limits<double>::infinity();
    for (int k = 0; k < 3; ++k) {
      if (!b.has(a.id[k])) least = std::min(least, point_triangle_distance_squared(a.p[k], b.p[0], b.p[1], b.p[2]));
      if (!a.has(b.id[k])) least = std::min(least, point_triangle_distance_squared(b.p[k], a.p[0], a.p[1], a.p[2]));
      for (int l = 0; l < 3; ++l) {
        const std::array u{a.id[k], a.id[(k + 1) % 3]}, w{b.id[l], b.id[(l + 1) % 3]};
        if (u[0] != w[0] && u[0] != w[1] && u[1] != w[0] && u[1] != w[1])
          least = std::min(least, edge_edge_distance_squared(a.p[k], a.p[(k + 1) % 3], b.p[l], b.p[(l + 1) % 3]));
      }
    }
    const double reach = 0.5 * uniform(random);
    EXPECT_DOUBLE_EQ(distance_below(a, b, reach), std::min(reach, std::sqrt(least)));
    EXPECT_EQ(come_near(a, b, reach), least < reach * reach);
    near += least < reach * reach;
  }
  EXPECT_GT(near, 500);
}

TEST(ContactReach3d, NeighbourhoodsAreKeptThroughEditsAndMoves) {
  int compared = 0, edited = 0;
  for (unsigned seed = 0; seed < 4; ++seed) {
    TetScene scene(seed);
    Strata<3> strata(scene.mesh);
    Gate<3> gate(scene.mesh, scene.fields, scene.context);
    const SurfaceIndex<3>& surface = gate.present();
    Neighbourhoods<3> kept;
    SurfaceIndex<3>::Hits hits;
    GateScratch<3> gate_scratch;
    const double radius = 0.7 * surface.span();
    for (int i = 0; i < 60; ++i) {
      const auto edit = random_edit(scene, strata, scene.random);
      if (!edit || !gate.passes(*edit, gate_scratch)) continue;
      const int first = scene.mesh.facet_slots();
      const VertexId created = scene.mesh.apply(*edit);
      scene.fields.follow(*edit, created);
      gate.follow(*edit, first);
      strata.follow(*edit, created);
      const VertexId moved = scene.mesh.facet(scene.mesh.facet_slots() - 1)[0];
      if (moved != kNone) {
        scene.fields.x.segment<3>(3 * moved) += Vec<3>(0.001, 0.002, -0.001);
        gate.move(moved);
      }
      ++edited;
      Neighbourhoods<3> fresh;
      for (FacetId f = 0; f < scene.mesh.facet_slots(); ++f) {
        if (!scene.mesh.is_facet_alive(f)) continue;
        std::map<SurfaceId, double> expected;
        for (const auto& [piece, distance] : fresh.near(surface, f, radius, hits)) expected[piece] = distance;
        for (const auto& [piece, distance] : kept.near(surface, f, radius, hits)) {
          ASSERT_TRUE(expected.contains(piece)) << "seed " << seed << ", edit " << i;
          ASSERT_EQ(distance, expected[piece]);
          compared += static_cast<int>(expected.erase(piece));
        }
        ASSERT_TRUE(expected.empty()) << "seed " << seed << ", edit " << i << ": not known to be near facet " << f;
      }
    }
  }
  EXPECT_GT(edited, 50);
  EXPECT_GT(compared, 1000);
}

TEST(Bounds3d, OfOneVertexNeverExceedWhatAPatchGains) {
  int compared = 0;
  for (unsigned seed = 0; compared < 300; ++seed) {
    TetScene scene(seed);
    if (find_inverted<3>(scene.mesh, scene.fields.x) != kNone) continue;
    const Strata<3> strata(scene.mesh);
    const Gate<3> gate(scene.mesh, scene.fields, scene.context);
    const RemeshState<3> state{scene.mesh, scene.fields, scene.context, gate.present(), HistoryRule::function};
    LocalScratch<3> scratch;
    Marks marks;
    for (int i = 0; i < 20; ++i) {
      const auto edit = random_edit(scene, strata, scene.random);
      if (!edit || !gate.passes(*edit, scratch.gate)) continue;
      const double bound = gain_of_vertex<3>(state, *edit, scratch);
      const auto patch = select_patch<3>(scene.mesh, *edit, {}, marks);
      LocalProblem<3> before(state, patch, *edit, false, scratch), after(state, patch, *edit, true, scratch);
      const double energy = before.value();
      const double gain = energy - (after.has_unknowns() ? after.relax(100).energy : after.value());
      if (!std::isfinite(bound) || !std::isfinite(gain)) continue;
      ASSERT_LE(bound, gain + 1e-11 * std::abs(energy)) << "seed " << seed << ", edit " << i;
      ++compared;
    }
  }
}

TEST(Remesh3d, KeepsVolumesAndTheStateValidAndHasTheSameBitsForAnyNumberOfThreads) {
  int split = 0, collapsed = 0, swapped = 0, moved = 0;
  for (const unsigned seed : {1u, 5u, 8u}) {
    const auto run = [&](int threads) {
      const ThreadLimit limit(threads);
      TetScene scene(seed, 4);
      EXPECT_EQ(find_inverted<3>(scene.mesh, scene.fields.x), kNone);
      RemeshOptions options = remesh_options();
      options.split.acceptance_tolerance = 2e-3;
      options.split.max_depth = 1;
      options.collapse.acceptance_tolerance = -1e-3;
      options.collapse.rel_max_edge_length = 100;
      options.swap.enabled = options.smooth.enabled = true;
      const Invariants before(scene.mesh, Strata<3>(scene.mesh));
      RemeshMemory memory;
      Strata<3> strata;
      const RemeshReport report = remesh(scene.mesh, scene.fields, scene.context, options, memory, strata);
      EXPECT_EQ(strata.find_defect(scene.mesh), "");
      EXPECT_EQ(scene.mesh.find_defect(), "");
      EXPECT_EQ(find_inverted<3>(scene.mesh, scene.fields.x), kNone);
      EXPECT_TRUE(std::isfinite(whole_energy(scene.mesh, scene.fields, scene.context)));
      const Invariants after(scene.mesh, Strata<3>(scene.mesh));
      for (const auto& [body, volume] : before.volume) EXPECT_NEAR(after.volume.at(body), volume, 1e-12);
      for (const auto& [tag, area] : before.area) EXPECT_NEAR(after.area.at(tag), area, 1e-12);
      split += report.splits.accepted;
      collapsed += report.collapses.accepted;
      swapped += report.swaps.accepted;
      moved += report.smooths.accepted;
      return scene.fields.x;
    };
    const VectorX one = run(1);
    for (const int threads : {2, 3}) {
      const VectorX several = run(threads);
      ASSERT_EQ(one.size(), several.size());
      EXPECT_TRUE((one.array() == several.array()).all());
    }
  }
  EXPECT_GT(split, 0);
  EXPECT_GT(collapsed, 0);
  EXPECT_GT(swapped, 0);
  EXPECT_GT(moved, 0);
}

/// All facets of a side of a cube are coplanar, and so is what a collapse there sweeps over.
TEST(Gate3d, LetsCollapsesOnFlatSurfacesPass) {
  const Mesh<3> mesh = make_cubes(
      4, [](int i, int j, int k) { return Vec<3>(Vec<3>(i, j, k) / 4); }, [](int, int, int) { return 1; });
  const Strata<3> strata(mesh);
  RemeshFields<3> fields;
  fields.x.resize(3 * mesh.node_slots());
  for (int v = 0; v < mesh.node_slots(); ++v) fields.x.segment<3>(3 * v) = mesh.rest(v);
  fields.past_positions = {fields.x};
  StepContext<3> context;
  context.contact = {.enabled = true, .dhat = 0.01};
  context.obstacles.past_x.resize(1);
  const Gate<3> gate(mesh, fields, context);
  GateScratch<3> scratch;
  int asked = 0, passed = 0;
  for (const EdgeKey& edge : mesh.edges()) {
    const auto proposal = propose_collapse<3>(mesh, strata, edge);
    if (!proposal || proposal.edit->inserted_facets.empty()) continue;
    ++asked;
    passed += gate.passes(*proposal.edit, scratch);
  }
  EXPECT_GT(asked, 20);
  EXPECT_EQ(passed, asked);
}

/// Quads that are flat at rest are not flat when deformed: the other diagonal takes in what is between the two.
TEST(Gate3d, LetsNoSwapTakeAnObstacleIn) {
  const Mesh<3> mesh = make_cubes(
      4, [](int i, int j, int k) { return Vec<3>(Vec<3>(i, j, k) / 4); }, [](int, int, int) { return 1; });
  const Strata<3> strata(mesh);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> noise(-0.02, 0.02);
  RemeshFields<3> fields;
  fields.x.resize(3 * mesh.node_slots());
  for (int v = 0; v < mesh.node_slots(); ++v)
    fields.x.segment<3>(3 * v) = mesh.rest(v) + Vec<3>(noise(random), noise(random), noise(random));
  fields.past_positions = {fields.x};
  const auto at = [&](VertexId v) -> Vec<3> { return fields.x.segment<3>(3 * v); };
  const auto lies_in_a_body = [&](const Vec<3>& p) {
    for (CellId c = 0; c < mesh.cell_slots(); ++c) {
      const auto& cell = mesh.cell(c);
      if (Simplex<3>({at(cell[0]), at(cell[1]), at(cell[2]), at(cell[3])}).barycentric(p).minCoeff() >= 0) return true;
    }
    return false;
  };
  StepContext<3> context;
  context.contact = {.enabled = true, .dhat = 0.01};
  GateScratch<3> scratch;
  int asked = 0, inward = 0;
  for (const EdgeKey& edge : mesh.edges()) {
    const auto proposal = propose_edge_removal(mesh, strata, edge, shape_cost(mesh));
    if (!proposal || proposal.edit->inserted_facets.empty()) continue;
    const auto passes = [&](const std::vector<Vec<3>>& nails) {
      context.obstacles.rest = context.obstacles.x = nails;
      context.obstacles.past_x = {nails};
      const Gate<3> gate(mesh, fields, context);
      return gate.passes(*proposal.edit, scratch);
    };
    if (!passes({})) continue;
    Vec<3> middle = Vec<3>::Zero();
    for (const auto& facet : proposal.edit->inserted_facets)
      for (const VertexId v : facet.vertices) middle += at(v) / (v == edge[0] || v == edge[1] ? 4 : 8);
    if (lies_in_a_body(middle)) {
      ++inward;
      continue;
    }
    ++asked;
    EXPECT_FALSE(passes({middle})) << "edge " << edge[0] << " " << edge[1];
    EXPECT_FALSE(passes({Vec<3>(-9, -9, -9), middle})) << "edge " << edge[0] << " " << edge[1];
  }
  EXPECT_GT(asked, 5);
  EXPECT_GT(inward, 5);
}

TEST(Prediction3d, OfASplitAloneIsThatOfItsEdit) {
  for (unsigned seed = 0; seed < 5; ++seed) {
    const TetScene scene(seed);
    if (find_inverted<3>(scene.mesh, scene.fields.x) != kNone) continue;
    const Gate<3> gate(scene.mesh, scene.fields, scene.context);
    const RemeshState<3> state{scene.mesh, scene.fields, scene.context, gate.present(), HistoryRule::interpolated};
    for (const EdgeKey& edge : scene.mesh.edges()) {
      const double gain = predict_gain<3>(state, make_split(scene.mesh, edge));
      EXPECT_NEAR(predict_split<3>(state, edge), gain, 1e-9 * std::abs(gain)) << "seed " << seed;
    }
  }
}

/// An elastic body without inertia that is distorted at random, vertices with tag 9 held, remeshed by swaps alone.
struct Swapped {
  Mesh<3> before, after;
  double gain = -1;
  Swapped(Mesh<3> mesh, double noise, std::mt19937& random) : before(mesh), after(std::move(mesh)) {
    std::uniform_real_distribution<double> shift(-noise, noise);
    RemeshFields<3> fields;
    fields.x.resize(3 * before.node_slots());
    for (int v = 0; v < before.node_slots(); ++v)
      fields.x.segment<3>(3 * v) = before.rest(v) + Vec<3>::NullaryExpr([&] { return shift(random); });
    if (find_inverted<3>(before, fields.x) != kNone) return;
    fields.past_positions = {fields.x};
    StepContext<3> context;
    context.obstacles.past_x.resize(1);
    context.materials[1] = {.youngs_modulus = 1000, .poisson_ratio = 0.3, .density = 1};
    context.has_inertia = false;
    context.held_components[9] = {true, true, true};
    context.newton.step_tolerance = 1e-9;
    RemeshOptions options = remesh_options();
    options.split.enabled = options.collapse.enabled = false;
    options.split.acceptance_tolerance = 1e-3;
    options.swap.enabled = true;
    const auto energy_on = [&](const Mesh<3>& slots) {
      const Gate<3> gate(slots, fields, context);
      const RemeshState<3> state{slots, fields, context, gate.present(), HistoryRule::function};
      const Edit<3> none{.kind = Edit<3>::Kind::swap};
      double sum = 0;
      for (CellId c = 0; c < slots.cell_slots(); ++c)
        if (slots.is_cell_alive(c)) sum += cell_energy<3>(state, slots.cell(c), slots.body(c), none);
      return sum;
    };
    const double energy = energy_on(before);
    RemeshMemory memory;
    Strata<3> strata;
    remesh(after, fields, context, options, memory, strata);
    gain = energy - energy_on(after);
    EXPECT_EQ(after.find_defect(), "");
    EXPECT_NEAR(after.total_volume(), before.total_volume(), 1e-12);
  }
};

TEST(Remesh3d, SwapsFindFacetsWhoseRemovalGains) {
  int removed = 0;
  std::mt19937 random(1);
  for (int i = 0; i < 100; ++i) {
    Mesh<3> two({{0, 0, 0}, {1, 0, 0}, {0.5, 0.9, 0}, {0.5, 0.3, 0.4}, {0.5, 0.3, -0.4}}, {{0, 1, 2, 3}, {0, 2, 1, 4}},
                {1, 1});
    for (VertexId v = 0; v < 5; ++v) two.set_vertex_tag(v, 9);
    const Swapped swapped(two, 0.2, random);
    if (swapped.after.num_cells() != 3) continue;
    EXPECT_GT(swapped.gain, 5e-5);  // a twentieth of what a split has to gain
    ++removed;
  }
  EXPECT_GT(removed, 5);
}

TEST(Remesh3d, SwapsReachFlatPatchesOfTheSurface) {
  std::mt19937 random(1);
  const int n = 3;
  const Mesh<3> cube = make_cubes(
      n, [&](int i, int j, int k) { return Vec<3>(Vec<3>(i, j, k) / n); }, [](int, int, int) { return 1; });
  const Swapped swapped(cube, 0.04, random);
  int swaps = 0;
  for (FacetId f = 0; f < swapped.after.facet_slots(); ++f)
    swaps += swapped.after.is_facet_alive(f) && swapped.before.find_facet(swapped.after.facet(f)) == kNone;
  EXPECT_GT(swaps, 0);
  EXPECT_GT(swapped.gain, 0);
  const Invariants before(swapped.before, Strata<3>(swapped.before)), after(swapped.after, Strata<3>(swapped.after));
  EXPECT_EQ(after.difference(before, 1e-12), "");
}

}  // namespace
}  // namespace itr
