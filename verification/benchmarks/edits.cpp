// SPDX-License-Identifier: MIT
// Time of making an edit of a tetrahedral mesh, checks included, of deciding about it, and of carrying it out, at 10^4, 10^5
// and 10^6 cells. The argument is the number of cubes along a side, six cells each. Proposals are made at random places, so
// that at a million cells most of what they read comes from memory.
#include <benchmark/benchmark.h>

#include <chrono>

#include "itr/energy/elastic/neo_hookean.hpp"
#include "random_tets.hpp"
#include "remesh/prediction.hpp"
#include "remesh/trial.hpp"

namespace {

using namespace itr;

/// An irregular mesh of a cube: perturbed, then changed by random operations.
struct Body {
  std::mt19937 random{1};
  Mesh<3> mesh;
  Strata<3> strata;
  VectorX x;

  explicit Body(int n) {
    std::uniform_real_distribution<double> noise(-0.2 / n, 0.2 / n);
    const auto place = [&](int i, int j, int k) {
      Vec<3> p = Vec<3>(i, j, k) / n;
      const int at[] = {i, j, k};
      for (int c = 0; c < 3; ++c)
        if (at[c] > 0 && at[c] < n) p[c] += noise(random);
      return p;
    };
    mesh = make_cubes(n, place, [](int, int, int) { return 1; });
    strata = Strata<3>(mesh);
    for (int i = mesh.num_cells() / 10; i > 0; --i)
      if (const auto proposal = propose_at_random(mesh, strata, static_cast<Operation>(random() % 5), random))
        apply(mesh, strata, *proposal.edit);
    strata.compact(mesh.compact());
    x.resize(3 * mesh.vertex_slots());
    for (int v = 0; v < mesh.vertex_slots(); ++v)
      for (int c = 0; c < 3; ++c) x[3 * v + c] = (c == 0 ? 0.8 : 1.05) * mesh.rest(v)[c] + 0.2 * noise(random);
  }

  std::vector<EdgeKey> edges(std::size_t count) {
    std::vector<EdgeKey> all = mesh.edges();
    std::shuffle(all.begin(), all.end(), random);
    all.resize(std::min(count, all.size()));
    return all;
  }
  /// Elastic energy at frozen positions.
  CellCost elastic_cost() const {
    return [this](const Mesh<3>::Cell& cell, int) {
      std::array<Vec<3>, 4> X, p;
      for (int k = 0; k < 4; ++k) X[k] = mesh.rest(cell[k]), p[k] = x.segment<3>(3 * cell[k]);
      const Mat<3> edges = edge_matrix<3>(X);
      return simplex_volume<3>(edges) * neo_hookean_density<3>(edge_matrix<3>(p) * edges.inverse(), {1e5, 2e5});
    };
  }
};

void propose(benchmark::State& state, Body& body, auto&& make) {
  constexpr std::size_t kPlaces = 4096;
  const auto edges = body.edges(kPlaces);
  std::size_t i = 0, made = 0;
  for (auto _ : state) {
    const auto proposal = make(edges[i++ % edges.size()]);
    made += proposal.edit.has_value();
    benchmark::DoNotOptimize(proposal.refusal);
  }
  state.SetItemsProcessed(state.iterations());
  state.counters["made"] = static_cast<double>(made) / static_cast<double>(state.iterations());
}

// Their names are those of the report: NOLINTBEGIN(readability-identifier-naming)

void ProposeSplit(benchmark::State& state) {
  Body body(static_cast<int>(state.range(0)));
  propose(state, body, [&](const EdgeKey& edge) { return propose_split<3>(body.mesh, edge); });
}

void ProposeCollapse(benchmark::State& state) {
  Body body(static_cast<int>(state.range(0)));
  propose(state, body, [&](const EdgeKey& edge) { return propose_collapse<3>(body.mesh, body.strata, edge); });
}

void ProposeEdgeRemoval(benchmark::State& state) {
  Body body(static_cast<int>(state.range(0)));
  const CellCost cost = body.elastic_cost();
  propose(state, body, [&](const EdgeKey& edge) { return propose_edge_removal(body.mesh, body.strata, edge, cost); });
}

void ProposeFacetRemoval(benchmark::State& state) {
  Body body(static_cast<int>(state.range(0)));
  propose(state, body, [&](const EdgeKey& edge) {
    const CellId c = body.mesh.cells_of(edge[0])[0];
    return propose_facet_removal(body.mesh, opposite_facet<3>(body.mesh.cell(c), edge[1] % 4));
  });
}

void ProposeMove(benchmark::State& state) {
  Body body(static_cast<int>(state.range(0)));
  propose(state, body, [&](const EdgeKey& edge) {
    const Vec<3>&a = body.mesh.rest(edge[0]), &b = body.mesh.rest(edge[1]);
    return propose_move<3>(body.mesh, body.strata, edge[0], a + 0.1 * (b - a));
  });
}

/// Three Newton steps towards the best shape around a vertex.
void BestShapedPosition(benchmark::State& state) {
  Body body(static_cast<int>(state.range(0)));
  propose(state, body, [&](const EdgeKey& edge) {
    benchmark::DoNotOptimize(best_shaped_position<3>(body.mesh, body.strata, edge[0], 3));
    return Proposal<3>{};
  });
}

/// Mesh::apply and Strata::follow alone, of all operations in turn; growth of the arrays included.
void ApplyEdit(benchmark::State& state) {
  Body body(static_cast<int>(state.range(0)));
  int i = 0;
  for (auto _ : state) {
    Proposal<3> proposal;
    while (!proposal) proposal = propose_at_random(body.mesh, body.strata, static_cast<Operation>(i++ % 5), body.random);
    const auto start = std::chrono::steady_clock::now();
    apply(body.mesh, body.strata, *proposal.edit);
    state.SetIterationTime(std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  }
  state.SetItemsProcessed(state.iterations());
}

/// A body in the middle of a step, pressed onto a plane where there is contact: what decides about an edit.
struct Step {
  Body body;
  RemeshFields<3> fields;
  StepContext<3> context;
  Gate<3> gate;
  RemeshState<3> state;
  LocalScratch<3> scratch;

  Step(int n, bool has_contact)
      : body(n),
        fields(make_fields(body)),
        context(make_context(n, has_contact)),
        gate(body.mesh, fields, context),
        state{body.mesh, fields, context, gate.present(), HistoryRule::function} {}

  static RemeshFields<3> make_fields(const Body& body) {
    return {.x = body.x, .predictor = body.x, .velocity_reference = body.x, .past_positions = {body.x}, .past_rates = {}};
  }
  static StepContext<3> make_context(int n, bool has_contact) {
    StepContext<3> context;
    context.materials[1] = {.youngs_modulus = 1e5, .poisson_ratio = 0.4, .density = 1000};
    context.scaling = 1e-4;
    context.newton.step_tolerance = 1e-9;
    if (!has_contact) return context;
    const double dhat = 0.1 / n;
    context.contact = {.enabled = true, .activation_distance = dhat, .convergent = true, .barrier_stiffness = 1e4};
    auto& obstacles = context.obstacles;
    obstacles.rest = obstacles.x = obstacles.velocity_reference = {{-9, -9, -dhat}, {9, -9, -dhat}, {0, 9, -dhat}};
    obstacles.triangles = {{0, 1, 2}};
    obstacles.edges = {{0, 1}, {1, 2}, {0, 2}};
    obstacles.past_x = {obstacles.x};
    return context;
  }
  /// As many around one place, whatever the size of the mesh: what is refined or coarsened lies together, so that the caches
  /// hold it. In contact those on the plane.
  std::vector<EdgeKey> edges() {
    const Mesh<3>& mesh = body.mesh;
    std::vector<EdgeKey> found = mesh.edges();
    const auto is_above = [&](const EdgeKey& e) { return mesh.rest(e[0])[2] > 0 || mesh.rest(e[1])[2] > 0; };
    if (context.contact.enabled) std::erase_if(found, is_above);
    const Vec<3> place(0.5, 0.5, context.contact.enabled ? 0 : 0.5);
    const auto away = [&](const EdgeKey& e) { return (mesh.rest(e[0]) + mesh.rest(e[1]) - 2 * place).squaredNorm(); };
    std::sort(found.begin(), found.end(), [&](const EdgeKey& a, const EdgeKey& b) { return away(a) < away(b); });
    found.resize(std::min<std::size_t>(found.size(), 200));
    std::shuffle(found.begin(), found.end(), body.random);
    return found;
  }
};

/// `decide` gets an edge, of which nothing is done.
void decide(benchmark::State& state, bool has_contact, auto&& decide) {
  Step step(static_cast<int>(state.range(0)), has_contact);
  const auto edges = step.edges();
  for (const EdgeKey& edge : edges) benchmark::DoNotOptimize(decide(step, edge));  // warms up
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(decide(step, edges[i++ % edges.size()]));
  state.SetItemsProcessed(state.iterations());
}

void PredictSplit(benchmark::State& state) {
  decide(state, false, [](Step& step, const EdgeKey& edge) { return predict_split<3>(step.state, edge); });
}

double bound(Step& step, const EdgeKey& edge) {
  return gain_of_vertex<3>(step.state, make_split(step.body.mesh, edge), step.scratch);
}
void BoundOfSplit(benchmark::State& state) { decide(state, false, bound); }
void BoundOfSplitInContact(benchmark::State& state) { decide(state, true, bound); }

/// Of a patch of two rings, refused.
double trial(Step& step, const EdgeKey& edge) {
  const auto edit = make_split(step.body.mesh, edge);
  return preview<3>(step.state, step.gate, edit, edit.value->rest, 1, {.required = 1e9, .local = {}}, step.scratch).gain;
}
void TrialOfSplit(benchmark::State& state) { decide(state, false, trial); }
void TrialOfSplitInContact(benchmark::State& state) { decide(state, true, trial); }

/// Whether a collapse keeps all stored configurations valid; what is asked are those that there are.
void check_collapse(benchmark::State& state, bool has_contact) {
  Step step(static_cast<int>(state.range(0)), has_contact);
  std::vector<Edit<3>> edits;
  for (const EdgeKey& edge : step.edges())
    if (auto proposal = propose_collapse<3>(step.body.mesh, step.body.strata, edge)) edits.push_back(*proposal.edit);
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(step.gate.passes(edits[i++ % edits.size()], step.scratch.hits));
  state.SetItemsProcessed(state.iterations());
}
void CheckCollapse(benchmark::State& state) { check_collapse(state, false); }
void CheckCollapseInContact(benchmark::State& state) { check_collapse(state, true); }

/// What an accepted split changes: the mesh, fields, strata, and the surface in each stored configuration; the vertices of
/// its cells move.
void AcceptSplit(benchmark::State& state) {
  Step step(static_cast<int>(state.range(0)), true);
  Mesh<3>& mesh = step.body.mesh;
  std::vector<EdgeKey> edges = step.edges();
  Marks moved;
  std::size_t i = 0;
  for (auto _ : state) {
    if (i == edges.size()) {
      state.PauseTiming();
      edges = step.edges();
      i = 0;
      state.ResumeTiming();
    }
    const EdgeKey edge = edges[i++];
    if (!mesh.are_joined(edge[0], edge[1])) continue;
    const auto edit = make_split(mesh, edge);
    const FacetId first_facet = mesh.facet_slots();
    const VertexId created = mesh.apply(edit);
    moved.clear(mesh.vertex_slots());
    step.fields.make_room(mesh.vertex_slots());
    step.fields.follow(edit, created);
    step.gate.follow(edit, first_facet);
    step.body.strata.follow(edit, created);
    step.gate.move(created);
    for (const CellId c : mesh.cells_of(created))
      for (const VertexId v : mesh.cell(c))
        if (moved.mark(v)) step.gate.move(v);
  }
  state.SetItemsProcessed(state.iterations());
}

// 10^3, 10^4 and 10^5 vertices; so many times, since what leads there takes longer.
void sizes(benchmark::internal::Benchmark* benchmark) { benchmark->Arg(9)->Arg(21)->Arg(46)->Iterations(4000); }
BENCHMARK(PredictSplit)->Apply(sizes);
BENCHMARK(BoundOfSplit)->Apply(sizes);
BENCHMARK(BoundOfSplitInContact)->Apply(sizes);
BENCHMARK(TrialOfSplit)->Apply(sizes);
BENCHMARK(TrialOfSplitInContact)->Apply(sizes);
BENCHMARK(CheckCollapse)->Apply(sizes);
BENCHMARK(CheckCollapseInContact)->Apply(sizes);
BENCHMARK(AcceptSplit)->Arg(9)->Arg(21)->Arg(46)->Iterations(1000);
BENCHMARK(ProposeSplit)->Arg(12)->Arg(26)->Arg(55);
BENCHMARK(ProposeCollapse)->Arg(12)->Arg(26)->Arg(55);
BENCHMARK(ProposeEdgeRemoval)->Arg(12)->Arg(26)->Arg(55);
BENCHMARK(ProposeFacetRemoval)->Arg(12)->Arg(26)->Arg(55);
BENCHMARK(ProposeMove)->Arg(12)->Arg(26)->Arg(55);
BENCHMARK(BestShapedPosition)->Arg(12)->Arg(26)->Arg(55);
BENCHMARK(ApplyEdit)->Arg(12)->Arg(26)->Arg(55)->UseManualTime();

// NOLINTEND(readability-identifier-naming)

}  // namespace
