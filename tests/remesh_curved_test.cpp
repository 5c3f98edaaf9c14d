// SPDX-License-Identifier: MIT
// Remeshing with curved edges: splits and curves keep every field as the function that it was, other operations stay away
// from curved edges, local problems see what the whole mesh sees, predictions are what trials find, and whole runs are
// valid.
#include <gtest/gtest.h>

#include <numeric>
#include <random>

#include "itr/core/parallel.hpp"
#include "itr/projection/transfer.hpp"
#include "itr/remesh/remesher.hpp"
#include "itr/simulation/simulation.hpp"
#include "random_mesh.hpp"
#include "random_tets.hpp"
#include "remesh/curved_cell.hpp"
#include "remesh/decide/prediction.hpp"
#include "remesh_options.hpp"
#include "simulation/invariants.hpp"

namespace itr {
namespace {

template <typename T>
class Curved : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(Curved, Dimensions);

template <int Dim>
Mesh<Dim> small_mesh(std::mt19937& random) {
  if constexpr (Dim == 2)
    return random_mesh(2, random);
  else
    return random_tets(2, random, false);
}

template <int Dim>
const Edit<Dim> kNoEdit{.kind = Edit<Dim>::Kind::split};

/// The function that a field is on a cell, at barycentric coordinates.
template <int Dim>
Vec<Dim> value_at(const Mesh<Dim>& mesh, const VectorX& field, CellId c, const std::array<double, Dim + 1>& l) {
  const CurvedCell<Dim> cell = curved_cell<Dim>(mesh.cell(c), [&](VertexId a, VertexId b) { return mesh.node_of(a, b); });
  return cell.values(field, kNoEdit<Dim>) * quadratic_shapes<Dim>(kAllCurved<Dim>, l);
}

template <int Dim>
struct Probe {
  Vec<Dim> X;
  int body;
  std::vector<Vec<Dim>> values;  ///< of each field
};

template <int Dim>
struct CurvedScene {
  std::mt19937 random;
  Mesh<Dim> mesh;
  RemeshFields<Dim> fields;
  Strata<Dim> strata;
  std::vector<Probe<Dim>> probes;

  /// A share of the edges is curved; fields differ from rest positions by so much.
  explicit CurvedScene(unsigned seed, double curved = 0.4, double noise = 0.1)
      : random(seed), mesh(small_mesh<Dim>(random)) {
    mesh.compact();
    strata = Strata<Dim>(mesh);
    for (const EdgeKey& edge : mesh.edges())
      if (std::uniform_real_distribution<double>(0, 1)(random) < curved) {
        mesh.add_node(edge);
        strata.add_nodes(1);
      }
    for (VectorX* field : {&fields.x, &fields.predictor}) *field = noisy(noise);
    fields.past_positions = {noisy(noise)};
    fields.past_rates = {noisy(1)};
    for (CellId c = 0; c < mesh.cell_slots(); ++c)
      for (int i = 0; i < 3; ++i) add_probe(c);
  }
  VectorX noisy(double noise) {
    std::uniform_real_distribution<double> off(-noise, noise);
    VectorX field(Dim * mesh.vertex_slots());
    for (int v = 0; v < mesh.vertex_slots(); ++v)
      for (int k = 0; k < Dim; ++k) field[Dim * v + k] = mesh.rest(v)[k] + off(random);
    return field;
  }
  void add_probe(CellId c) {
    std::uniform_real_distribution<double> part(0.05, 1);
    std::array<double, Dim + 1> l;
    double sum = 0;
    for (double& w : l) sum += w = part(random);
    Probe<Dim> probe{Vec<Dim>::Zero(), mesh.body(c), {}};
    for (int k = 0; k <= Dim; ++k) probe.X += (l[k] /= sum) * mesh.rest(mesh.cell(c)[k]);
    fields.for_each([&](const VectorX& field) { probe.values.push_back(value_at<Dim>(mesh, field, c, l)); });
    probes.push_back(probe);
  }
  void apply(const Edit<Dim>& edit) {
    const VertexId created = mesh.apply(edit);
    fields.follow(edit, created, mesh.vertex_slots() - static_cast<int>(edit.inserted_nodes.size()));
    strata.follow(edit, created);
    ASSERT_EQ(mesh.find_defect(), "");
    ASSERT_EQ(strata.find_misfit(mesh), "");
  }
  EdgeKey edge() {
    const auto edges = mesh.edges();
    return edges[random() % edges.size()];
  }
  /// Largest change of a field at a probe.
  double largest_change() {
    double largest = 0;
    for (const Probe<Dim>& probe : probes) {
      double deepest = -1;
      std::array<double, Dim + 1> l{};
      CellId cell = kNone;
      for (CellId c = 0; c < mesh.cell_slots(); ++c) {
        if (!mesh.is_cell_alive(c) || mesh.body(c) != probe.body) continue;
        const Vec<Dim> w = mesh.inverse_rest_edges(c) * (probe.X - mesh.rest(mesh.cell(c)[0]));
        const double depth = std::min(w.minCoeff(), 1 - w.sum());
        if (depth <= deepest) continue;
        deepest = depth;
        cell = c;
        l[0] = 1 - w.sum();
        for (int k = 0; k < Dim; ++k) l[k + 1] = w[k];
      }
      EXPECT_GT(deepest, -1e-9);
      std::size_t i = 0;
      fields.for_each([&](const VectorX& field) {
        largest = std::max(largest, (value_at<Dim>(mesh, field, cell, l) - probe.values[i++]).norm());
      });
    }
    return largest;
  }
};

TYPED_TEST(Curved, SplitsAndCurvesKeepEveryFunction) {
  constexpr int Dim = TypeParam::value;
  int curves = 0, splits = 0;
  for (unsigned seed = 0; seed < 30; ++seed) {
    CurvedScene<Dim> scene(seed, 0.1 * (seed % 11));
    for (int i = 0; i < (Dim == 2 ? 40 : 25); ++i) {
      const EdgeKey edge = scene.edge();
      if (scene.random() % 3 == 0 && scene.mesh.node_of(edge[0], edge[1]) == kNone) {
        scene.apply(make_curve(scene.mesh, edge));
        ++curves;
      } else if (const auto proposal = propose_split(scene.mesh, edge)) {
        scene.apply(*proposal.edit);
        ++splits;
      }
      if (this->HasFatalFailure()) return;
    }
    EXPECT_LT(scene.largest_change(), 1e-13) << "seed " << seed;
  }
  EXPECT_GT(curves, 100);
  EXPECT_GT(splits, 300);
}

TYPED_TEST(Curved, OtherOperationsStayAwayFromCurvedEdges) {
  constexpr int Dim = TypeParam::value;
  int done = 0, refused = 0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    CurvedScene<Dim> scene(seed, 0.05);
    for (int i = 0; i < 6; ++i)
      if (const auto proposal = propose_split(scene.mesh, scene.edge())) scene.apply(*proposal.edit);
    for (int i = 0; i < 60; ++i) {
      const EdgeKey edge = scene.edge();
      Proposal<Dim> proposal;
      switch (scene.random() % 3) {
        case 0:
          proposal = propose_collapse(scene.mesh, scene.strata, edge);
          break;
        case 1:
          if constexpr (Dim == 2)
            proposal = propose_diagonal_swap(scene.mesh, scene.strata, edge);
          else
            proposal = propose_edge_removal(scene.mesh, scene.strata, edge, [](const auto&, int) { return 1; });
          break;
        default:
          proposal =
              propose_move(scene.mesh, scene.strata, edge[0], best_shaped_position(scene.mesh, scene.strata, edge[0], 3));
      }
      refused += proposal.refusal == Refusal::curved;
      if (!proposal) continue;
      ++done;
      for (const CellId c : proposal.edit->removed_cells) ASSERT_FALSE(scene.mesh.is_curved(c));
      const int first = scene.mesh.cell_slots();
      scene.apply(*proposal.edit);
      if (this->HasFatalFailure()) return;
      for (CellId c = first; c < scene.mesh.cell_slots(); ++c) ASSERT_FALSE(scene.mesh.is_curved(c));
    }
  }
  EXPECT_GT(done, 50);
  EXPECT_GT(refused, 50);
}

template <int Dim>
StepContext<Dim> context_of(unsigned seed) {
  StepContext<Dim> context;
  for (int body = 1; body <= 3; ++body)
    context.materials[body] = {.youngs_modulus = 10.0 * body, .poisson_ratio = 0.1 * body, .density = 1.0 + body};
  if (seed % 3 == 1)
    for (auto& [body, material] : context.materials) material.law = MaterialLaw::linear;
  context.scaling = 0.01;
  context.has_inertia = seed % 2 == 0;
  context.newton.step_tolerance = 1e-9;
  context.shortest_edge = 0.1;
  context.loads.acceleration = [](const Vec<Dim>&) { return Vec<Dim>(Vec<Dim>::Unit(Dim - 1) * -0.2); };
  context.loads.tractions.emplace_back(1, [](const Vec<Dim>&) { return Vec<Dim>(Vec<Dim>::Unit(0) * 0.03); });
  context.held_components[Dim == 2 ? 2 : 0].fill(true);
  context.obstacles.past_x.resize(1);  // of the one past position
  return context;
}

/// All terms on the whole mesh, in the numbering of a space.
template <int Dim>
double whole_energy(const Mesh<Dim>& slots, const RemeshFields<Dim>& fields, const StepContext<Dim>& context,
                    bool* was_refined = nullptr) {
  Mesh<Dim> mesh = slots;
  const auto nodes = mesh.nodes();
  const auto map = mesh.compact();
  std::vector<EdgeKey> curved;
  for (const auto& [edge, node] : nodes) curved.push_back({map.vertex[edge[0]], map.vertex[edge[1]]});
  const Space space(curved);
  const auto compacted = [&](const VectorX& field) {
    VectorX kept(Dim * num_nodes(mesh, space));
    for (std::size_t v = 0; v < map.vertex.size(); ++v)
      if (map.vertex[v] != kNone) kept.segment<Dim>(Dim * map.vertex[v]) = field.segment<Dim>(Dim * static_cast<int>(v));
    for (std::size_t i = 0; i < nodes.size(); ++i)
      kept.segment<Dim>(Dim * (mesh.vertex_slots() + static_cast<int>(i))) = field.segment<Dim>(Dim * nodes[i].second);
    return kept;
  };
  const CellSet<Dim> cells = whole_mesh(mesh, {}, space);
  const VectorX x = compacted(fields.x), predictor = compacted(fields.predictor);
  IncrementalPotential<Dim> potential(context, cells, {.predictor = predictor, .velocity_reference = predictor});
  if (was_refined) *was_refined = potential.elastic()->refine_quadrature(x);
  Workspace workspace;
  return potential.sum(potential.lag(x, workspace)).value(x, workspace);
}

template <int Dim>
struct View {
  Gate<Dim> gate;
  LocalScratch<Dim> scratch;
  RemeshState<Dim> state;
  explicit View(const CurvedScene<Dim>& scene, const StepContext<Dim>& context)
      : gate(scene.mesh, scene.fields, context),
        state{scene.mesh, scene.fields, context, gate.present(), HistoryRule::function} {}
};

/// Cells are far from inversions here, so that no energy needs more points of quadrature.
/// The gain that a patch finds is the fall of the energy of the whole mesh where the edit and its positions are taken over.
TYPED_TEST(Curved, PatchesSeeWhatTheWholeMeshSees) {
  constexpr int Dim = TypeParam::value;
  int compared = 0, moved_nodes = 0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    CurvedScene<Dim> scene(seed, seed % 4 == 0 ? 0 : 0.3, 0.001);
    const StepContext<Dim> context = context_of<Dim>(seed);
    for (int i = 0; i < 6; ++i) {
      const EdgeKey edge = scene.edge();
      const bool curves = scene.random() % 2 && scene.mesh.node_of(edge[0], edge[1]) == kNone;
      const Edit<Dim> edit = curves ? make_curve(scene.mesh, edge) : make_split(scene.mesh, edge);
      const double before = whole_energy(scene.mesh, scene.fields, context);
      Verdict<Dim> verdict;
      {
        View<Dim> view(scene, context);
        preview<Dim>(view.state, view.gate, edit, {.required = -1e9, .local = {.rings = 1 + i % 3}}, view.scratch, verdict);
        ASSERT_NE(verdict.refusal, Refusal::invalid) << "seed " << seed;
        LocalProblem<Dim> at_start(view.state, verdict.patch, edit, false, view.scratch),
            after(view.state, verdict.patch, edit, true, view.scratch);
        const double start = at_start.value();
        const double relaxed = after.has_unknowns() ? after.relax(3).energy : after.value();
        after.get_positions(verdict.positions);
        scene.apply(edit);
        const VertexId first_node = scene.mesh.vertex_slots() - static_cast<int>(edit.inserted_nodes.size());
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
TYPED_TEST(Curved, PatchesRefineQuadratureAsTheStepDoes) {
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
TYPED_TEST(Curved, StraighteningIsChargedForWhatItForgets) {
  constexpr int Dim = TypeParam::value;
  int compared = 0;
  for (unsigned seed = 0; seed < 40; ++seed) {
    CurvedScene<Dim> scene(seed, 0.5, 0.001);
    const StepContext<Dim> context = context_of<Dim>(seed);
    const View<Dim> view(scene, context);
    LocalScratch<Dim> scratch;
    const auto nodes = scene.mesh.nodes();
    if (nodes.empty()) continue;
    const auto [edge, node] = nodes[scene.random() % nodes.size()];
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

/// With a quadratic energy the prediction of a curve is what the new node alone gains.
TYPED_TEST(Curved, PredictionOfACurveIsWhatItsNodeGains) {
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

/// A bending bar without contact.
template <int Dim>
Setup<Dim> bar() {
  Setup<Dim> setup;
  if constexpr (Dim == 2) {
    const Grid grid = make_grid(
        4, [](int i, int j) { return Vec<2>(i, 0.25 * j); }, [](int i, int j) { return (i + j) % 2; });
    setup.mesh = Mesh<2>(grid.rest, grid.cells, std::vector<int>(grid.cells.size(), 1));
  } else {
    setup.mesh = make_cubes(
        2, [](int i, int j, int k) { return Vec<3>(2 * i, 0.5 * j, 0.5 * k); }, [](int, int, int) { return 1; });
  }
  for (FacetId f = 0; f < setup.mesh.facet_slots(); ++f) {
    const auto& facet = setup.mesh.facet(f);
    const bool at_wall = std::all_of(facet.begin(), facet.end(), [&](int v) { return setup.mesh.rest(v)[0] == 0; });
    setup.mesh.set_facet_tag(f, at_wall ? 7 : kNoTag);
  }
  std::array<bool, Dim> all;
  all.fill(true);
  setup.dirichlet = {{7, all, [](const Vec<Dim>&, double) { return Vec<Dim>(Vec<Dim>::Zero()); }}};
  setup.materials[1] = {.youngs_modulus = 1e5, .poisson_ratio = 0.3, .density = 1000};
  setup.body_acceleration = [](const Vec<Dim>&, double) { return Vec<Dim>(Vec<Dim>::Unit(1) * -2); };
  setup.time.dt = 0.02;
  setup.time.steps = 6;
  setup.remesh.enabled = true;
  setup.remesh.split.acceptance_tolerance = Dim == 2 ? 0.01 : 0.02;
  setup.remesh.collapse.rel_max_edge_length = 2;
  setup.remesh.swap.enabled = setup.remesh.smooth.enabled = true;
  return setup;
}

template <int Dim>
struct Run {
  int splits = 0, curves = 0, collapses = 0;
  State<Dim> state;
};

template <int Dim>
Run<Dim> run(Setup<Dim> setup) {
  setup.choose_defaults();
  linear::Registry registry;
  Simulation<Dim> simulation(setup, registry);
  Run<Dim> result;
  while (!simulation.finished()) {
    const StepResult step = simulation.advance();
    EXPECT_TRUE(step.ok) << step.reason;
    if (!step.ok) break;
    result.splits += step.report.splits.accepted;
    result.curves += step.report.curves.accepted;
    result.collapses += step.report.collapses.accepted;
    EXPECT_EQ(step.report.reverted_remeshes, 0);
    const State<Dim>& state = simulation.state();
    for (const VectorX& x : state.history.x) EXPECT_EQ(find_violation(setup, state.mesh, x, state.space), "");
  }
  result.state = simulation.state();
  return result;
}

template <int Dim>
void expect_same(const State<Dim>& a, const State<Dim>& b) {
  ASSERT_EQ(a.mesh.vertex_slots(), b.mesh.vertex_slots());
  EXPECT_TRUE(a.space == b.space);
  EXPECT_EQ(a.history.x[0], b.history.x[0]);
  EXPECT_EQ(a.history.v[0], b.history.v[0]);
}

TYPED_TEST(Curved, RunsChooseTheOrderToo) {
  constexpr int Dim = TypeParam::value;
  Setup<Dim> setup = bar<Dim>();
  setup.remesh.curve.enabled = true;
  const Run<Dim> both = run<Dim>(setup);
  EXPECT_GT(both.curves, 5);
  EXPECT_EQ(both.state.space.num_curved() > 0, true);
  for (const int threads : {1, 3}) {
    const ThreadLimit limit(threads);
    expect_same(run<Dim>(setup).state, both.state);
  }
}

/// Collapses and swaps beside curved edges: the projection of the history stays within straight cells, and keeps momentum.
TYPED_TEST(Curved, RunsInFreeFlightKeepMomentum) {
  constexpr int Dim = TypeParam::value;
  Setup<Dim> setup = bar<Dim>();
  setup.dirichlet.clear();
  setup.body_acceleration = nullptr;
  setup.initial_velocity = {{1, [](const Vec<Dim>& X, double) {
                               return Vec<Dim>(Vec<Dim>::Unit(0) + 2 * std::sin(1.5 * X[0]) * Vec<Dim>::Unit(1));
                             }}};
  setup.newton.step_tolerance = 1e-10;
  setup.remesh.curve.enabled = true;
  setup.remesh.split.acceptance_tolerance = Dim == 2 ? 0.2 : 0.1;
  setup.remesh.collapse.acceptance_tolerance = -0.05;
  setup.remesh.straighten.enabled = true;
  setup.remesh.collapse.rel_max_edge_length = 3;
  const auto momentum = [&](const State<Dim>& state) {
    const CellSet<Dim> cells = whole_mesh(state.mesh, {}, state.space);
    VectorX product = VectorX::Zero(state.history.v[0].size());
    InertiaEnergy<Dim>(cells, setup.materials, MassKind::consistent, VectorX::Zero(product.size()))
        .add_mass_product(state.history.v[0], product);
    Vec<Dim> sum = Vec<Dim>::Zero();
    for (Eigen::Index i = 0; i < product.size(); i += Dim) sum += product.segment<Dim>(i);
    return sum;
  };
  setup.choose_defaults();
  linear::Registry registry;
  Simulation<Dim> simulation(setup, registry);
  const Vec<Dim> before = momentum(simulation.state());
  int curves = 0, coarsened = 0, straightened = 0;
  while (!simulation.finished()) {
    const StepResult step = simulation.advance();
    ASSERT_TRUE(step.ok) << step.reason;
    curves += step.report.curves.accepted;
    straightened += step.report.straightens.accepted;
    coarsened += step.report.collapses.accepted + step.report.swaps.accepted + step.report.smooths.accepted;
  }
  EXPECT_GT(curves, 3);
  EXPECT_GT(coarsened, 3);
  EXPECT_GT(straightened, 0);
  EXPECT_LT((momentum(simulation.state()) - before).norm(), 1e-9 * before.norm());
}

/// Without splits the mesh stays; a scene of order 2 splits curved edges.
TYPED_TEST(Curved, RunsWithOneOfTheTwo) {
  constexpr int Dim = TypeParam::value;
  Setup<Dim> setup = bar<Dim>();
  setup.remesh.split.enabled = setup.remesh.collapse.enabled = setup.remesh.swap.enabled = setup.remesh.smooth.enabled =
      false;
  setup.remesh.curve.enabled = true;
  const Run<Dim> curved = run<Dim>(setup);
  EXPECT_GT(curved.curves, 5);
  EXPECT_EQ(curved.state.mesh.num_vertices(), setup.mesh.num_vertices());

  setup = bar<Dim>();
  setup.order[1] = 2;
  setup.remesh.split.acceptance_tolerance = Dim == 2 ? 5e-3 : 1e-3;
  const Run<Dim> split = run<Dim>(setup);
  EXPECT_GT(split.splits, 3);
  EXPECT_EQ(split.curves, 0);
  EXPECT_TRUE(is_all_curved(split.state.mesh, split.state.space));
}

}  // namespace
}  // namespace itr
