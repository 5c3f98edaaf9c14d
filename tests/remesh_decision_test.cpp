// SPDX-License-Identifier: MIT
// Decisions about edits: bounds, the memory of refusals, the gate, and where it finds the surface.
#include <gtest/gtest.h>

#include <random>
#include <set>

#include "fem/inverted.hpp"
#include "geometry/dynamic_tree.hpp"
#include "random_mesh.hpp"
#include "remesh/decide/patch.hpp"
#include "remesh/remesher.hpp"
#include "remesh_options.hpp"

namespace itr {
namespace {

Box<2> random_box(std::mt19937& random) {
  std::uniform_real_distribution<double> place(0, 10), size(0, 0.5);
  Box<2> box;
  const Vec<2> corner(place(random), place(random));
  box.include(corner);
  box.include(Vec<2>(corner + Vec<2>(size(random), size(random))));
  return box;
}

TEST(DynamicTree, FindsWhatASearchThroughAllBoxesFinds) {
  std::mt19937 random(1);
  std::vector<Box<2>> boxes(200);
  for (auto& box : boxes) box = random_box(random);
  boxes[7] = {};  // not there
  DynamicTree<2> tree;
  tree.build(boxes);
  for (int i = 0; i < 3000; ++i) {
    const int item = static_cast<int>(random() % boxes.size());
    const bool there = tree.holds(item);
    ASSERT_EQ(there, boxes[item].min[0] <= boxes[item].max[0]);
    if (there && random() % 3 == 0) {
      tree.remove(item);
      boxes[item] = {};
    } else {
      const Box<2> box = random_box(random);
      there ? tree.update(item, box) : tree.insert(item, box);
      boxes[item] = box;
    }
    const Box<2> asked = random_box(random);
    std::vector<int> hits, expected;
    tree.query(asked, hits);
    std::sort(hits.begin(), hits.end());
    for (std::size_t k = 0; k < boxes.size(); ++k)
      if (boxes[k].overlaps(asked)) expected.push_back(static_cast<int>(k));
    ASSERT_EQ(hits, expected) << "round " << i;
  }
}

/// The gain of one vertex exists: a patch that relaxes to convergence gains no less, in contact too.
TEST(Bounds, OfOneVertexNeverExceedWhatAPatchGains) {
  int compared = 0, in_contact = 0;
  for (unsigned seed = 0; compared < 10000; ++seed) {
    TrialScene scene(seed);
    if (find_inverted<2>(scene.mesh, scene.fields.x) != kNone) continue;
    LocalView view(scene);
    Marks marks;
    for (int i = 0; i < 100; ++i) {
      const auto edit = random_edit(scene.mesh, scene.random);
      if (!edit || !view.gate.passes(*edit, view.scratch.gate)) continue;
      const double bound = gain_of_vertex<2>(view.state, *edit, view.scratch);
      const auto patch = select_patch<2>(scene.mesh, *edit, {}, marks);
      const auto before = view.problem(patch, *edit, false), after = view.problem(patch, *edit, true);
      const double energy = before->value();
      const double gain = energy - (after->has_unknowns() ? after->relax(100).energy : after->value());
      if (!std::isfinite(bound) || !std::isfinite(gain)) continue;
      ASSERT_LE(bound, gain + 1e-12 * std::abs(energy)) << "seed " << seed << ", edit " << i;
      ++compared;
      in_contact += after->touches_contact();
    }
  }
  EXPECT_GT(in_contact, 1000);
}

TEST(Memory, NothingIsAskedTwiceWhereNothingChanged) {
  TrialScene scene(3);
  RemeshOptions options = remesh_options();
  options.split.acceptance_tolerance = 1e-3;
  options.collapse.rel_max_edge_length = 100;
  options.swap.enabled = options.smooth.enabled = true;
  RemeshMemory memory;
  Strata<2> strata;
  RemeshReport report = remesh(scene.mesh, scene.fields, scene.context, options, memory, strata);
  EXPECT_TRUE(report.changed());
  // Each refusal has one reason, in all operations alike.
  for (const OperationCount& count : {report.splits, report.collapses, report.swaps, report.smooths}) {
    int by_trials = 0;
    for (const auto reason : {Refusal::invalid, Refusal::bound, Refusal::energy, Refusal::no_unknowns})
      by_trials += count.refused_by(reason);
    EXPECT_EQ(count.tried, count.accepted + by_trials);
    EXPECT_GT(by_trials, 0);
  }
  EXPECT_GT(report.splits.refused_by(Refusal::prediction), 0);
  EXPECT_GT(report.swaps.refused_by(Refusal::shape), 0);
  for (int i = 0; i < 20 && report.changed(); ++i)
    report = remesh(scene.mesh, scene.fields, scene.context, options, memory, strata);
  ASSERT_FALSE(report.changed());
  report = remesh(scene.mesh, scene.fields, scene.context, options, memory, strata);
  const int relaxed = report.splits.relaxed + report.collapses.relaxed + report.swaps.relaxed + report.smooths.relaxed;
  EXPECT_EQ(relaxed, 0);
  RemeshMemory none;
  report = remesh(scene.mesh, scene.fields, scene.context, options, none, strata);
  EXPECT_GT(report.splits.relaxed + report.collapses.relaxed, 0);
}

TEST(Candidate, TellsKindsVerticesEdgesAndFacetsApart) {
  const Candidate edge(OperationKind::split, EdgeKey{4, 2}), curve(OperationKind::curve, EdgeKey{2, 4});
  const Candidate vertex(OperationKind::smooth, 2), facet(OperationKind::remove_facet, MeshTypes<3>::Facet{7, 2, 4});
  EXPECT_EQ(edge, Candidate(OperationKind::split, EdgeKey{2, 4}));
  EXPECT_EQ(edge.edge(), (EdgeKey{2, 4}));
  EXPECT_EQ(facet.facet(), (MeshTypes<3>::Facet{2, 4, 7}));
  EXPECT_TRUE(edge.is_edge() && curve.is_edge());
  EXPECT_FALSE(vertex.is_edge() || facet.is_edge());
  EXPECT_EQ(std::set({edge, curve, vertex, facet}).size(), 4u);
  EXPECT_EQ(edge.vertices().size(), 2u);
  EXPECT_EQ(facet.vertices().size(), 3u);
  EXPECT_EQ(vertex.vertices().size(), 1u);
  EXPECT_EQ(vertex.vertex(), 2);
}

TEST(Memory, FollowsVerticesWhenAMeshIsCompacted) {
  RemeshMemory memory;
  const RemeshMemory::KeyRange refusal{1, 2, false};
  for (const EdgeKey& edge : {EdgeKey{0, 3}, EdgeKey{1, 2}, EdgeKey{2, 3}})
    memory.refusals.push_back({Candidate(OperationKind::split, edge), refusal});
  for (const VertexId v : {1, 3}) memory.refusals.push_back({Candidate(OperationKind::smooth, v), refusal});
  const std::vector<VertexId> number{2, kNone, 0, 1};
  memory.renumber(number);
  std::vector<Candidate> kept;
  for (const auto& entry : memory.refusals) kept.push_back(entry.candidate);
  EXPECT_EQ(kept, (std::vector{Candidate(OperationKind::split, EdgeKey{0, 1}), Candidate(OperationKind::smooth, 1),
                               Candidate(OperationKind::split, EdgeKey{1, 2})}));
}

/// A row of triangles under y = 0 whose top bulges; an obstacle point is above it or below.
struct BulgeScene {
  Mesh<2> mesh;
  RemeshFields<2> fields;
  StepContext<2> context;
  explicit BulgeScene(const Vec<2>& point) {
    const std::vector<Vec<2>> rest{{0, 0}, {1, 0}, {2, 0}, {3, 0}, {0, -1}, {1, -1}, {2, -1}, {3, -1}};
    mesh = Mesh<2>(rest, {{4, 5, 0}, {5, 1, 0}, {5, 6, 1}, {6, 2, 1}, {6, 7, 2}, {7, 3, 2}}, std::vector<int>(6, 1));
    context.materials[1] = {.youngs_modulus = 10, .poisson_ratio = 0.3, .density = 1};
    context.contact = {.enabled = true, .dhat = 1e-3};
    fields.x.resize(16);
    for (int v = 0; v < 8; ++v) fields.x.segment<2>(2 * v) = rest[v];
    fields.x[3] = -0.3;  // the second vertex of the top is pressed in by the point
    auto& obstacles = context.obstacles;
    obstacles.rest = obstacles.x = obstacles.velocity_reference = {point};
    obstacles.past_x = {obstacles.x};
    fields.past_positions = {fields.x};
  }
};

TEST(Gate, RefusesCollapsesThatSweepOverAnObstaclePoint) {
  for (const bool blocked : {true, false}) {
    const BulgeScene scene(blocked ? Vec<2>(1, -0.2) : Vec<2>(1, 0.2));
    const Gate<2> gate(scene.mesh, scene.fields, scene.context);
    const auto edit = propose_collapse(scene.mesh, Strata<2>(scene.mesh), {1, 2}).edit;
    ASSERT_TRUE(edit.has_value());
    GateScratch<2> scratch;
    EXPECT_EQ(gate.passes(*edit, scratch), !blocked);
  }
}

}  // namespace
}  // namespace itr
