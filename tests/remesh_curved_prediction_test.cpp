// SPDX-License-Identifier: MIT
// Edits at curved edges before they are made: patches see what the whole mesh sees, and predictions are what trials find.
#include <gtest/gtest.h>

#include <map>
#include <numeric>

#include "curved_scene.hpp"
#include "curved_trial.hpp"
#include "energy/elastic/jacobian_barrier.hpp"
#include "remesh/decide/prediction.hpp"
#include "remesh/decide/prospect.hpp"
#include "remesh/decide/queries.hpp"
#include "remesh/paper/baseline.hpp"
#include "remesh_options.hpp"

namespace itr {
namespace {

template <typename T>
class CurvedPrediction : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(CurvedPrediction, Dimensions);

/// All terms on the whole mesh, in the numbering of the compact mesh.
template <int Dim>
double whole_energy(const Mesh<Dim>& slots, const RemeshFields<Dim>& fields, const StepContext<Dim>& context,
                    bool* was_refined = nullptr) {
  const Compact<Dim> compact(slots);
  const CellSet<Dim> cells = whole_mesh(compact.mesh, {});
  const VectorX x = compact.field(fields.x), predictor = compact.field(fields.predictor);
  IncrementalPotential<Dim> potential(context, cells, {.predictor = predictor, .velocity_reference = predictor});
  if (was_refined) *was_refined = potential.elastic()->refine_quadrature(x);
  Workspace workspace;
  return potential.sum(potential.lag(x, workspace)).value(x, workspace);
}

/// The paper's culling ranks edges by the energy of cells, that of their nodes too.
TYPED_TEST(CurvedPrediction, CullingSeesWhatNodesStore) {
  constexpr int Dim = TypeParam::value;
  CurvedScene<Dim> scene(3, 0, 0);
  const EdgeKey bent = scene.mesh.edges().front();
  scene.apply(make_curve(scene.mesh, bent));
  scene.fields.x[Dim * scene.mesh.node_of(bent[0], bent[1])] += 0.02;
  StepContext<Dim> context = context_of<Dim>(1);
  RemeshOptions options;
  options.screening = Screening::energy_percentile;
  options.split.acceptance_tolerance = 1e-9;
  options.split.min_edge_length = 0;
  const Gate<Dim> gate(scene.mesh, scene.fields, context);
  const auto culling = Baseline<Dim>::chosen_by(options);
  culling->rank(RemeshQueries<Dim>(scene.mesh, scene.fields, context, options, scene.strata, gate, culling.get(), nullptr));
  EXPECT_TRUE(culling->may_split(bent));
  int may = 0;
  for (const EdgeKey& edge : scene.mesh.edges()) may += culling->may_split(edge);
  EXPECT_LT(may, static_cast<int>(scene.mesh.edges().size()) / 2);
}

/// Cells are far from inversions here, so that no energy needs more points of quadrature.
/// The gain that a patch finds is the fall of the energy of the whole mesh where the edit and its positions are taken over.
TYPED_TEST(CurvedPrediction, PatchesSeeWhatTheWholeMeshSees) {
  constexpr int Dim = TypeParam::value;
  int compared = 0, moved_nodes = 0;
  for (unsigned seed = 0; seed < 80; ++seed) {
    CurvedScene<Dim> scene(seed, seed % 4 == 0 ? 0 : 0.3, 0.001);
    const StepContext<Dim> context = context_of<Dim>(seed);
    for (int i = 0; i < 6; ++i) {
      const auto proposal = propose_any(scene);
      if (!proposal) continue;
      const Edit<Dim>& edit = *proposal.edit;
      const double before = whole_energy(scene.mesh, scene.fields, context);
      Verdict<Dim> verdict;
      {
        View<Dim> view(scene, context, HistoryRule::interpolated);
        preview<Dim>(view.state, view.gate, edit, {.required = -1e9, .local = {.rings = 1 + i % 3}}, view.scratch, verdict);
        if (verdict.refusal == Refusal::invalid) continue;
        LocalProblem<Dim> at_start(view.state, verdict.patch, edit, false, view.scratch),
            after(view.state, verdict.patch, edit, true, view.scratch);
        const double start = at_start.value();
        const double relaxed = after.has_unknowns() ? after.relax(3).energy : after.value();
        after.get_positions(verdict.positions);
        scene.apply(edit);
        const VertexId first_node = scene.mesh.node_slots() - static_cast<int>(edit.inserted_nodes.size());
        for (const auto& [v, x] : verdict.positions) {
          const VertexId slot = v == kNewVertex         ? first_node - 1
                                : v > kNewVertex - 1000 ? first_node + (kNewVertex - 1 - v)
                                                        : v;
          scene.fields.x.template segment<Dim>(Dim * slot) = x;
          moved_nodes += scene.mesh.edge_of_node(slot)[0] != kNone;
        }
        const double now = whole_energy(scene.mesh, scene.fields, context);
        EXPECT_NEAR(before - now, start - relaxed, 1e-11 * std::abs(before) + 1e-13) << "seed " << seed << ", edit " << i;
        ++compared;
      }
    }
  }
  EXPECT_GT(compared, 100);
  EXPECT_GT(moved_nodes, 100);
}

/// Else corners of curved cells come to an inversion by local solves that see none, and no step leaves it.
TYPED_TEST(CurvedPrediction, PatchesRefineQuadratureAsTheStepDoes) {
  constexpr int Dim = TypeParam::value;
  int refined = 0;
  for (unsigned seed = 0; seed < 400; ++seed) {
    CurvedScene<Dim> scene(seed, 0.5, (0.2 + 0.01 * (seed % 80)) * (Dim == 2 ? 0.12 : 0.06));
    const StepContext<Dim> context = context_of<Dim>(seed);
    bool was_refined = false;
    const double whole = whole_energy(scene.mesh, scene.fields, context, &was_refined);
    if (!was_refined || !std::isfinite(whole)) continue;
    const View<Dim> view(scene, context);
    LocalScratch<Dim> scratch;
    std::vector<CellId> all(scene.mesh.cell_slots());
    std::iota(all.begin(), all.end(), 0);
    const Edit<Dim> edit = make_split(scene.mesh, scene.edge());
    EXPECT_NEAR(LocalProblem<Dim>(view.state, all, edit, false, scratch).value(), whole, 1e-12 * std::abs(whole)) << seed;
    ++refined;
  }
  EXPECT_GT(refined, 5);
}

/// A straight edge is a curved one with its node at the mean of the ends. So the space after straightening lies in the one
/// before, and the energy of what it can hold, forgotten history included, is that on the mesh before.
TYPED_TEST(CurvedPrediction, StraighteningIsChargedForWhatItForgets) {
  constexpr int Dim = TypeParam::value;
  int compared = 0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    CurvedScene<Dim> scene(seed, 0.5, 0.001);
    const StepContext<Dim> context = context_of<Dim>(seed);
    const View<Dim> view(scene, context);
    LocalScratch<Dim> scratch;
    const auto edges = scene.mesh.curved_edges();
    if (edges.empty()) continue;
    const EdgeKey edge = edges[scene.random() % edges.size()];
    const VertexId node = scene.mesh.node_of(edge);
    const Edit<Dim> edit = make_straighten(scene.mesh, edge);
    const double gain = LocalProblem<Dim>(view.state, edit.removed_cells, edit, false, scratch).value() -
                        LocalProblem<Dim>(view.state, edit.removed_cells, edit, true, scratch).value();
    const double before = whole_energy(scene.mesh, scene.fields, context);
    RemeshFields<Dim> straight = scene.fields;
    const auto at = [&](VertexId v) { return straight.x.template segment<Dim>(Dim * v); };
    at(node) = (at(edge[0]) + at(edge[1])) / 2;
    EXPECT_NEAR(gain, before - whole_energy(scene.mesh, straight, context), 1e-11 * std::abs(before) + 1e-13)
        << "seed " << seed;
    ++compared;
  }
  EXPECT_GT(compared, 30);
}

/// Edge removals minimise the energy of the cells that an edit makes, with the nodes that it makes.
TYPED_TEST(CurvedPrediction, EnergiesOfCellsAreThoseOfPatches) {
  constexpr int Dim = TypeParam::value;
  int curved = 0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    CurvedScene<Dim> scene(seed, 0.5, 0.001);
    StepContext<Dim> context = context_of<Dim>(seed);
    context.loads.tractions.clear();
    const auto proposal = propose_any(scene);
    if (!proposal || proposal.edit->value) continue;  // as a swap, it sets no vertex
    const Edit<Dim>& edit = *proposal.edit;
    const View<Dim> view(scene, context, HistoryRule::interpolated);
    LocalScratch<Dim> scratch;
    double sum = 0;
    for (const auto& cell : edit.inserted_cells) {
      sum += cell_energy<Dim>(view.state, cell.vertices, cell.body, edit);
      curved += cell_after(scene.mesh, edit, cell.vertices).edges != 0;
    }
    const double expected = LocalProblem<Dim>(view.state, edit.removed_cells, edit, true, scratch).value();
    EXPECT_NEAR(sum, expected, 1e-9 * std::abs(expected)) << "seed " << seed;
  }
  EXPECT_GT(curved, 10);
}

/// With a quadratic energy the prediction of a swap is no less than what its one node gains alone.
TYPED_TEST(CurvedPrediction, PredictionOfASwapHasWhatItsNodeGains) {
  constexpr int Dim = TypeParam::value;
  int compared = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    CurvedScene<Dim> scene(seed, 0.5, 0.001);
    StepContext<Dim> context = context_of<Dim>(3 * seed + 1);
    context.loads.tractions.clear();
    View<Dim> view(scene, context, HistoryRule::interpolated);
    for (int i = 0; i < 10; ++i) {
      const auto proposal = propose_any(scene);
      if (!proposal || proposal.edit->kind != Edit<Dim>::Kind::swap || proposal.edit->inserted_nodes.size() != 1) continue;
      const Edit<Dim>& edit = *proposal.edit;
      LocalProblem<Dim> after(view.state, edit.removed_cells, edit, true, view.scratch);
      if (after.num_unknowns() != Dim) continue;  // others are free, too
      const double before = LocalProblem<Dim>(view.state, edit.removed_cells, edit, false, view.scratch).value();
      const double gained = before - after.relax(1).energy, predicted = predict_gain<Dim>(view.state, edit);
      EXPECT_GE(predicted, gained - 1e-9 * before) << "seed " << seed;
      ++compared;
    }
  }
  EXPECT_GT(compared, 5);
}

TYPED_TEST(CurvedPrediction, NoSplitGainsMoreThanIsAvailable) {
  constexpr int Dim = TypeParam::value;
  int compared = 0;
  for (unsigned seed = 0; seed < 30; ++seed) {
    CurvedScene<Dim> scene(seed, 0.2 * (seed % 6), seed % 2 ? 0.001 : 0.02);
    StepContext<Dim> context = context_of<Dim>(2 * seed);
    context.loads.tractions.clear();
    context.coupling = 0;
    View<Dim> view(scene, context);
    const double available = available_energy(scene.mesh, scene.fields, context);
    for (int i = 0; i < 5; ++i) {
      const Edit<Dim> edit = make_split(scene.mesh, scene.edge());
      LocalProblem<Dim> before(view.state, edit.removed_cells, edit, false, view.scratch),
          after(view.state, edit.removed_cells, edit, true, view.scratch);
      if (!after.has_unknowns() || !std::isfinite(before.value())) continue;
      EXPECT_LE(before.value() - after.relax(20).energy, available) << "seed " << seed;
      ++compared;
    }
  }
  EXPECT_GT(compared, 50);
}

/// The available energy is the same on a mesh whose edges are curved and have their nodes at the middle.
TYPED_TEST(CurvedPrediction, AvailableEnergyIsOfTheFunctions) {
  constexpr int Dim = TypeParam::value;
  for (unsigned seed = 0; seed < 20; ++seed) {
    CurvedScene<Dim> scene(seed, 0, 0.01);
    StepContext<Dim> context = context_of<Dim>(2 * seed);
    context.loads.tractions.clear();
    context.coupling = 0.5;
    const double straight = available_energy(scene.mesh, scene.fields, context);
    for (int i = 0; i < 10; ++i)
      if (const EdgeKey edge = scene.edge(); scene.mesh.node_of(edge[0], edge[1]) == kNone)
        scene.apply(make_curve(scene.mesh, edge));
    EXPECT_NEAR(available_energy(scene.mesh, scene.fields, context), straight, 1e-12 * straight) << "seed " << seed;
  }
}

/// The energies of cells have the barrier of distorted ones, and predictions without it cannot tell there.
TYPED_TEST(CurvedPrediction, BarriersArePartOfEnergies) {
  constexpr int Dim = TypeParam::value;
  int compared = 0;
  for (unsigned seed = 1; seed < 1200; seed += 2) {
    CurvedScene<Dim> scene(seed, 0.5, (0.2 + 0.01 * (seed % 80)) * (Dim == 2 ? 0.12 : 0.06));
    StepContext<Dim> context = context_of<Dim>(seed);
    context.loads = {};
    context.coupling = 0;
    const Compact<Dim> compact(scene.mesh);
    const CellSet<Dim> cells = whole_mesh(compact.mesh, {});
    Workspace workspace;
    const VectorX x = compact.field(scene.fields.x);
    const double whole =
        ElasticEnergy<Dim>(cells, context.materials, context.scaling, context.quadrature_degree).value(x, workspace);
    const auto is_active = [&](const auto& e) { return JacobianBarrier<Dim>(e, at_nodes<Dim>(e.nodes(), x)).is_active(); };
    const auto active = std::ranges::find_if(cells.curved(), is_active);
    if (active == cells.curved().end() || !std::isfinite(whole)) continue;
    const View<Dim> view(scene, context);
    const Edit<Dim> none{.kind = Edit<Dim>::Kind::split};
    double sum = 0;
    for (CellId c = 0; c < scene.mesh.cell_slots(); ++c)
      sum += cell_energy<Dim>(view.state, scene.mesh.cell(c), scene.mesh.body(c), none);
    EXPECT_NEAR(sum, whole, 1e-10 * whole) << "seed " << seed;
    EXPECT_NEAR(available_energy(scene.mesh, scene.fields, context), whole, 1e-10 * whole) << "seed " << seed;
    for (const EdgeKey& edge : edges_of<Dim>(scene.mesh, std::array{active->cell})) {
      EXPECT_TRUE(std::isnan(predict_split_at_curves<Dim>(view.state, edge)));
      EXPECT_TRUE(std::isnan(scene.mesh.node_of(edge[0], edge[1]) == kNone ? predict_curve<Dim>(view.state, edge)
                                                                           : predict_straighten<Dim>(view.state, edge)));
      EXPECT_TRUE(std::isinf(predict_gain<Dim>(view.state, make_split(scene.mesh, edge))));
    }
    ++compared;
  }
  EXPECT_GT(compared, 3);
}

/// With a quadratic energy the prediction of a split at curved edges is what its nodes gain together.
TYPED_TEST(CurvedPrediction, PredictionOfASplitIsWhatItsNodesGain) {
  constexpr int Dim = TypeParam::value;
  int compared = 0, left_out = 0;
  for (unsigned seed = 0; seed < 120; ++seed) {
    CurvedScene<Dim> scene(seed, 0.2 * (seed % 6), seed % 2 ? 0.001 : 0.02);
    const StepContext<Dim> context = context_of<Dim>(3 * seed + 1);
    View<Dim> view(scene, context);
    for (int i = 0; i < 5; ++i) {
      const EdgeKey edge = scene.edge();
      const Edit<Dim> edit = make_split(scene.mesh, edge);
      LocalProblem<Dim> after(view.state, edit.removed_cells, edit, true, view.scratch);
      std::vector<typename LocalProblem<Dim>::Position> free;
      after.get_positions(free);
      if (std::any_of(free.begin(), free.end(), [](const auto& at) { return at.vertex < kNewVertex - 1000; })) continue;
      const double predicted = predict_split_at_curves<Dim>(view.state, edge);
      if (std::isnan(predicted)) {
        ++left_out;
        continue;
      }
      const double before = LocalProblem<Dim>(view.state, edit.removed_cells, edit, false, view.scratch).value();
      EXPECT_NEAR(predicted, before - after.relax(1).energy, 1e-9 * std::abs(before)) << "seed " << seed;
      ++compared;
    }
  }
  EXPECT_GT(compared, 50);
  EXPECT_GT(left_out, 5);  // at loaded facets
}

/// With a quadratic energy the prediction of a curve is what the new node alone gains.
TYPED_TEST(CurvedPrediction, PredictionOfACurveIsWhatItsNodeGains) {
  constexpr int Dim = TypeParam::value;
  int compared = 0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    CurvedScene<Dim> scene(seed, seed % 2 ? 0.4 : 0, seed % 2 ? 0.001 : 0.02);
    const StepContext<Dim> context = context_of<Dim>(3 * seed + 1);
    View<Dim> view(scene, context);
    for (int i = 0; i < 5; ++i) {
      const EdgeKey edge = scene.edge();
      if (scene.mesh.node_of(edge[0], edge[1]) != kNone) continue;
      const Edit<Dim> edit = make_curve(scene.mesh, edge);
      LocalProblem<Dim> after(view.state, edit.removed_cells, edit, true, view.scratch);
      std::vector<typename LocalProblem<Dim>::Position> free;
      after.get_positions(free);
      if (free.size() != 1 || free[0].vertex != new_node(0)) continue;  // others are free too
      const double start = after.value(), gained = start - after.relax(1).energy;
      EXPECT_NEAR(predict_curve<Dim>(view.state, edge), gained, 1e-9 * std::abs(start)) << "seed " << seed;
      ++compared;
    }
  }
  EXPECT_GT(compared, 20);
}

/// The prediction of a straightening is what it costs where nothing moves, forgotten history included.
TYPED_TEST(CurvedPrediction, PredictionOfAStraighteningIsWhatItCosts) {
  constexpr int Dim = TypeParam::value;
  int compared = 0, left_out = 0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    CurvedScene<Dim> scene(seed, 0.5, seed % 5 ? 0.001 : 0.02);
    const StepContext<Dim> context = context_of<Dim>(seed);
    View<Dim> view(scene, context);
    for (const EdgeKey& edge : scene.mesh.curved_edges()) {
      const Edit<Dim> edit = make_straighten(scene.mesh, edge);
      const double before = LocalProblem<Dim>(view.state, edit.removed_cells, edit, false, view.scratch).value();
      const double after = LocalProblem<Dim>(view.state, edit.removed_cells, edit, true, view.scratch).value();
      const double predicted = predict_straighten<Dim>(view.state, edge);
      left_out += std::isnan(predicted);
      if (std::isnan(predicted) || !std::isfinite(after) || !std::isfinite(before)) continue;
      EXPECT_NEAR(predicted, before - after, 1e-9 * std::abs(before))
          << "seed " << seed << ", node " << scene.mesh.node_of(edge);
      ++compared;
    }
  }
  EXPECT_GT(compared, 100);
  EXPECT_GT(left_out, 5);  // at loaded facets
}

}  // namespace
}  // namespace itr
