// SPDX-License-Identifier: MIT
// Edits and trials on random meshes: what they conserve, and that a patch sees exactly what the whole mesh would see.
#include <gtest/gtest.h>

#include <map>
#include <random>

#include "fem/inverted.hpp"
#include "geometry/intersection.hpp"
#include "random_mesh.hpp"
#include "remesh/decide/patch.hpp"
#include "remesh/decide/prediction.hpp"
#include "remesh/remesher.hpp"
#include "remesh_options.hpp"
#include "whole_mesh_energy.hpp"

namespace itr {
namespace {

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

TEST(Edits, KeepVerticesWithTagsAndWhatTheyHold) {
  double lengths = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    Mesh<2> mesh = random_mesh(4, random);
    std::map<VertexId, Vec<2>> held;
    for (VertexId v = 0; v < mesh.node_slots(); ++v) {
      if (!mesh.is_boundary(v) || random() % 2) continue;
      mesh.set_vertex_tag(v, 7);
      held[v] = mesh.rest(v);
    }
    const auto length = [&] {
      double sum = 0;
      for (FacetId f = 0; f < mesh.facet_slots(); ++f) {
        if (!mesh.is_facet_alive(f)) continue;
        const auto [a, b] = mesh.facet(f);
        if (mesh.vertex_tag(a) == 7 && mesh.vertex_tag(b) == 7) sum += (mesh.rest(a) - mesh.rest(b)).norm();
      }
      return sum;
    };
    const double before = length();
    lengths += before;
    for (int i = 0; i < 300; ++i)
      if (const auto edit = random_edit(mesh, random)) mesh.apply(*edit);
    for (const auto& [v, place] : held) {
      ASSERT_TRUE(mesh.is_vertex_alive(v)) << seed;
      ASSERT_EQ(mesh.rest(v), place) << seed;
    }
    mesh.compact();
    EXPECT_NEAR(length(), before, 1e-13) << seed;
  }
  EXPECT_GT(lengths, 10);
}

TEST(LocalProblem, EnergyDifferenceOfAnEditEqualsTheGlobalOne) {
  int compared = 0, in_contact = 0;
  for (unsigned seed = 0; seed < 30; ++seed) {
    TrialScene scene(seed);
    const auto edit = random_edit(scene.mesh, scene.random);
    if (!edit) continue;
    Marks marks;
    const auto patch = select_patch<2>(scene.mesh, *edit, {}, marks);
    LocalView view(scene, HistoryRule::interpolated);
    const auto before = view.problem(patch, *edit, false), after = view.problem(patch, *edit, true);
    const double local = after->value() - before->value();
    const double global_before = global_energy(scene.mesh, scene.fields, scene.context);
    Mesh<2> changed = scene.mesh;
    RemeshFields<2> fields = scene.fields;
    fields.follow(*edit, changed.apply(*edit));
    const double global_after = global_energy(changed, fields, scene.context);
    if (!std::isfinite(global_before) || !std::isfinite(global_after)) continue;  // inverted by the random state
    EXPECT_NEAR(local, global_after - global_before, 1e-12 * std::abs(global_before)) << "seed " << seed;
    ++compared;
    in_contact += before->touches_contact();
  }
  EXPECT_GT(compared, 15);
  EXPECT_GT(in_contact, 5);
}

TEST(LocalProblem, RelaxationLowersTheGlobalEnergyByWhatItReports) {
  for (unsigned seed = 100; seed < 110; ++seed) {
    TrialScene scene(seed);
    const auto edges = scene.mesh.edges();
    const auto edit = make_split(scene.mesh, edges[scene.random() % edges.size()]);
    Marks marks;
    const auto patch = select_patch<2>(scene.mesh, edit, {}, marks);
    LocalView view(scene);
    const auto after = view.problem(patch, edit, true);
    const double start = after->value(), end = after->relax(5).energy;
    Mesh<2> changed = scene.mesh;
    RemeshFields<2> fields = scene.fields;
    const VertexId created = changed.apply(edit);
    fields.follow(edit, created);
    const double global_start = global_energy(changed, fields, scene.context);
    write_back(*after, created, fields.x);
    const double global_end = global_energy(changed, fields, scene.context);
    EXPECT_LT(end, start);
    EXPECT_NEAR(end - start, global_end - global_start, 1e-12 * std::abs(global_start)) << "seed " << seed;
  }
}

/// The part of x-hat that a coarser mesh cannot represent counts after a collapse: 1/2 the integral of rho times its square.
TEST(LocalProblem, HistoryAsAFunctionChargesTheIntegralOfWhatIsForgotten) {
  int compared = 0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    TrialScene scene(seed);
    scene.fields.x = scene.fields.predictor;  // at rest with respect to the history: all inertia is loss
    const auto edges = scene.mesh.edges();
    const auto edit = propose_collapse(scene.mesh, Strata<2>(scene.mesh), edges[scene.random() % edges.size()]).edit;
    if (!edit) continue;
    Marks marks;
    const auto patch = select_patch<2>(scene.mesh, *edit, {}, marks);
    const auto inertia = [&](HistoryRule rule) { return LocalView(scene, rule).problem(patch, *edit, true)->value(); };
    const double kept = inertia(HistoryRule::function), forgotten = inertia(HistoryRule::interpolated);
    if (!std::isfinite(kept)) continue;  // inverted by the random state
    Mesh<2> coarser = scene.mesh;
    RemeshFields<2> fields = scene.fields;
    fields.follow(*edit, coarser.apply(*edit));
    const double loss =
        squared_distance(scene.mesh, scene.fields.predictor, coarser, fields.predictor, scene.context.materials);
    EXPECT_GT(loss, 0);
    EXPECT_NEAR(kept - forgotten, loss, 1e-10 * loss) << "seed " << seed;
    ++compared;
  }
  EXPECT_GT(compared, 5);
}

/// For each collapse, and for all but a few moves.
TEST(LocalProblem, PredictionsChargeLessThanWhatIsForgotten) {
  int compared = 0, above = 0;
  for (unsigned seed = 0; seed < 2000; ++seed) {
    TrialScene scene(seed);
    scene.fields.x = scene.fields.predictor;  // all inertia is loss
    const auto edges = scene.mesh.edges();
    const EdgeKey edge = edges[scene.random() % edges.size()];
    const Strata<2> strata(scene.mesh);
    const auto edit = (seed % 2 ? propose_collapse(scene.mesh, strata, edge)
                                : propose_move<2>(scene.mesh, strata, edge[0],
                                                  0.7 * scene.mesh.rest(edge[0]) + 0.3 * scene.mesh.rest(edge[1])))
                          .edit;
    if (!edit) continue;
    Marks marks;
    const auto patch = select_patch<2>(scene.mesh, *edit, {}, marks);
    const auto inertia = [&](HistoryRule rule) { return LocalView(scene, rule).problem(patch, *edit, true)->value(); };
    const double forgotten = inertia(HistoryRule::function) - inertia(HistoryRule::interpolated);
    if (!std::isfinite(forgotten)) continue;  // inverted by the random state
    const double least = least_forgotten(LocalView(scene).state, *edit);
    EXPECT_GT(least, 0) << "seed " << seed;
    EXPECT_TRUE(least <= forgotten || edit->kind == Edit<2>::Kind::smooth) << "seed " << seed;
    above += least > forgotten;
    ++compared;
  }
  EXPECT_GT(compared, 1500);
  EXPECT_LE(above, 2);
}

/// Lumped masses of a split mesh integrate inertia otherwise than those before it: that is no gain.
TEST(LocalProblem, SplitsAloneChangeNoEnergyWithLumpedMassEither) {
  for (const MassKind mass : {MassKind::consistent, MassKind::lumped})
    for (unsigned seed = 0; seed < 10; ++seed) {
      TrialScene scene(seed);
      scene.context.mass = mass;
      scene.context.contact.enabled = false;
      for (Eigen::Index i = 0; i < scene.fields.x.size(); ++i)  // from rest: no cell is inverted
        scene.fields.x[i] = scene.mesh.rest(static_cast<int>(i / 2))[i % 2] + 1e-3 * std::sin(7.0 * i);
      const auto edges = scene.mesh.edges();
      const auto edit = make_split(scene.mesh, edges[scene.random() % edges.size()]);
      Marks marks;
      const auto patch = select_patch<2>(scene.mesh, edit, {}, marks);
      LocalView view(scene);
      const double before = view.problem(patch, edit, false)->value();
      EXPECT_NEAR(view.problem(patch, edit, true)->value(), before, 1e-12 * std::abs(before)) << "seed " << seed;
    }
}

/// A collapse with lumped mass forgets what the old vertices, with their masses, are away from the new function.
TEST(LocalProblem, ForgottenHistoryUsesTheLumpedMass) {
  int compared = 0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    TrialScene scene(seed);
    StepContext<2> context;
    context.materials = scene.context.materials;
    context.mass = MassKind::lumped;
    context.scaling = 0;
    scene.context = context;
    scene.fields.x = scene.fields.predictor;
    const auto edges = scene.mesh.edges();
    const auto edit = propose_collapse(scene.mesh, Strata<2>(scene.mesh), edges[scene.random() % edges.size()]).edit;
    if (!edit || edit->value->num_parents != 1) continue;  // onto one of its ends: one vertex disappears
    Marks marks;
    const auto patch = select_patch<2>(scene.mesh, *edit, {}, marks);
    const double kept = LocalView(scene).problem(patch, *edit, true)->value();
    if (!std::isfinite(kept)) continue;  // inverted by the random state
    const VertexId gone = edit->removed_vertex;
    double mass = 0;
    for (const CellId c : scene.mesh.cells_of(gone))
      mass += scene.context.materials.at(scene.mesh.body(c)).density * scene.mesh.volume(c) / 3;
    Mesh<2> changed = scene.mesh;
    RemeshFields<2> fields = scene.fields;
    fields.follow(*edit, changed.apply(*edit));
    Vec<2> there = Vec<2>::Zero();
    double deepest = -1;
    for (const auto& cell : edit->inserted_cells) {
      std::array<Vec<2>, 3> p;
      for (int k = 0; k < 3; ++k) p[k] = changed.rest(cell.vertices[k]);
      const Vec<3> weights = Simplex<2>(p).barycentric(scene.mesh.rest(gone));
      if (weights.minCoeff() <= deepest) continue;
      deepest = weights.minCoeff();
      there.setZero();
      for (int k = 0; k < 3; ++k) there += weights[k] * fields.predictor.segment<2>(2 * cell.vertices[k]);
    }
    const double expected = 0.5 * mass * (there - scene.fields.predictor.segment<2>(2 * gone)).squaredNorm();
    EXPECT_NEAR(kept, expected, 1e-12 * expected) << "seed " << seed;
    ++compared;
  }
  EXPECT_GT(compared, 3);
}

/// Linear elasticity has a quadratic energy: the prediction for the new vertex alone is then exact.
TEST(Prediction, OfTheNewVertexIsWhatRelaxingItAloneGains) {
  int compared = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    TrialScene scene(seed);
    scene.context.contact.enabled = false;
    for (auto& [body, material] : scene.context.materials) material.law = MaterialLaw::linear;
    const auto edges = scene.mesh.edges();
    const EdgeKey edge = edges[scene.random() % edges.size()];
    const auto edit = make_split(scene.mesh, edge);
    // In a patch of nothing but the split cells only the new vertex is free.
    LocalView view(scene);
    const auto after = view.problem(edit.removed_cells, edit, true);
    if (after->num_unknowns() != 2) continue;
    const double start = after->value(), gained = start - after->relax(1).energy;
    const double unsplit = view.problem(edit.removed_cells, edit, false)->value();
    EXPECT_NEAR(unsplit, start, 1e-12 * std::abs(start)) << "seed " << seed;
    EXPECT_NEAR(predict_gain<2>(view.state, edit), gained, 1e-9 * std::abs(start)) << "seed " << seed;
    ++compared;
  }
  EXPECT_GT(compared, 5);
}

TEST(Prediction, OfASplitAloneIsThatOfItsEdit) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    TrialScene scene(seed);
    scene.context.has_inertia = seed % 3 != 0;
    for (auto& [body, material] : scene.context.materials)
      if (seed % 4 == 0) material.law = MaterialLaw::fixed_corotated;
    if (seed % 5 == 0)
      scene.context.loads.acceleration = [](const Vec<2>& X) { return Vec<2>(3 * X[1] * X[1], -9.81 + X[0] * X[1]); };
    const LocalView view(scene);
    for (const EdgeKey& edge : scene.mesh.edges()) {
      const double gain = predict_gain<2>(view.state, make_split(scene.mesh, edge));
      EXPECT_NEAR(predict_split<2>(view.state, edge), gain, 1e-9 * std::abs(gain) + 1e-13) << "seed " << seed;
    }
  }
}

/// A fraction of it, from the vertex that disappears alone; what a patch cannot get back is not far from that
/// (prediction.cpp).
TEST(Prediction, CountsAShareOfTheHistoryThatACollapseForgets) {
  int compared = 0, too_large = 0, too_small = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    TrialScene scene(seed);
    scene.context.contact.enabled = false;
    scene.context.mass = MassKind::consistent;
    scene.fields.x = scene.fields.predictor;  // else the way from there to x counts too, which differs from cell to cell
    if (find_inverted<2>(scene.mesh, scene.fields.x) != kNone) continue;
    const auto edges = scene.mesh.edges();
    const auto edit = propose_collapse(scene.mesh, Strata<2>(scene.mesh), edges[scene.random() % edges.size()]).edit;
    if (!edit) continue;
    LocalView function(scene), interpolated(scene, HistoryRule::interpolated);
    const double all = function.problem(edit->removed_cells, *edit, true)->value() -
                       interpolated.problem(edit->removed_cells, *edit, true)->value();
    const double predicted = predict_gain<2>(interpolated.state, *edit) - predict_gain<2>(function.state, *edit);
    if (!std::isfinite(all)) continue;
    too_large += predicted > all;
    too_small += predicted < 0.05 * all;
    ++compared;
  }
  EXPECT_GT(compared, 30);
  EXPECT_EQ(too_large, 0);
  EXPECT_LT(too_small, compared / 10);
}

TEST(Remesh, BoundsFindEdgesThatCullingByEnergyLeavesOut) {
  std::map<Screening, int> tried;
  for (unsigned seed = 0; seed < 5; ++seed)
    for (const auto screening : {Screening::energy_percentile, Screening::bounds}) {
      TrialScene scene(seed);
      RemeshOptions options = remesh_options();
      options.collapse.enabled = false;
      options.screening = screening;
      RemeshMemory memory;
      Strata<2> strata;
      tried[screening] += remesh(scene.mesh, scene.fields, scene.context, options, memory, strata).splits.tried;
    }
  EXPECT_GT(tried[Screening::energy_percentile], 0);
  EXPECT_GT(tried[Screening::bounds], 2 * tried[Screening::energy_percentile]);
}

/// Where no prediction knows what a split depends on, a refusal of one step says nothing of the next.
TEST(Remesh, AsksAgainWhatWasRefusedWhereNoPredictionTells) {
  for (const bool pressure : {false, true}) {
    TrialScene scene(1, 6, {.pressure = pressure, .damping = !pressure});
    scene.context.contact.enabled = false;
    RemeshOptions options = remesh_options();
    options.collapse.enabled = false;
    options.split.acceptance_tolerance = 1e6;  // none gains that
    RemeshMemory memory;
    Strata<2> strata;
    const auto first = remesh(scene.mesh, scene.fields, scene.context, options, memory, strata).splits;
    ASSERT_GT(first.tried, 0);
    ASSERT_EQ(first.accepted, 0);
    options.split.acceptance_tolerance = 1e-6;  // as if forces had grown
    EXPECT_GT(remesh(scene.mesh, scene.fields, scene.context, options, memory, strata).splits.accepted, 0);
  }
}

/// Bad shapes do harm where the deformation varies, not where it does not.
TEST(Remesh, BettersShapesWhereTheyDoHarm) {
  std::mt19937 random(3);
  Mesh<2> mesh = random_mesh(16, random);
  StepContext<2> context;
  for (const int body : {1, 2}) context.materials[body] = {.youngs_modulus = 1000, .poisson_ratio = 0.3, .density = 1};
  context.has_inertia = false;
  context.newton.step_tolerance = 1e-9;
  context.obstacles.past_x.resize(1);
  RemeshFields<2> fields;
  fields.x.resize(2 * mesh.node_slots());
  for (int v = 0; v < mesh.node_slots(); ++v) {
    const Vec<2>& X = mesh.rest(v);
    fields.x.segment<2>(2 * v) = X + (X[0] < 0.4 ? Vec<2>(0, std::pow(0.4 - X[0], 2)) : Vec<2>(0, 0));
  }
  fields.past_positions = {fields.x};
  RemeshOptions options = remesh_options();
  options.split.enabled = options.collapse.enabled = false;
  options.split.acceptance_tolerance = 1e-3;
  options.swap.enabled = options.smooth.enabled = true;
  const Mesh<2> before = mesh;
  RemeshMemory memory;
  Strata<2> strata;
  remesh(mesh, fields, context, options, memory, strata);
  int near = 0;
  for (CellId c = 0; c < before.cell_slots(); ++c) {
    const double x = before.rest(before.cell(c)[0])[0];
    const bool is_kept = mesh.is_cell_alive(c);
    if (x > 0.7) {
      EXPECT_TRUE(is_kept) << "cell " << c;
    }
    near += x < 0.3 && !is_kept;
  }
  EXPECT_GT(near, 10);
}

TEST(Remesh, EveryRunIsDeterministicAndKeepsTheMeshValid) {
  const auto run = [](unsigned seed) {
    TrialScene scene(seed);
    RemeshOptions options = remesh_options();
    options.split.acceptance_tolerance = 1e-3;
    options.split.culling_threshold = 0.5;
    options.collapse.rel_max_edge_length = 100;
    options.collapse.culling_threshold = 0.5;
    options.collapse.acceptance_tolerance = -1e-3;
    options.swap.enabled = options.smooth.enabled = true;
    const Totals before(scene.mesh);
    RemeshMemory memory;
    Strata<2> strata;
    const auto report = remesh(scene.mesh, scene.fields, scene.context, options, memory, strata);
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
