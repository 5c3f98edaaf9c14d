// SPDX-License-Identifier: MIT
// Time of deciding about an edit, and of what an accepted one changes, at 10^3, 10^4 and 10^5 vertices in the plane and in
// space. The argument is the number of squares or cubes along a side.
#include <benchmark/benchmark.h>

#include "bodies.hpp"
#include "remesh/decide/prediction.hpp"
#include "remesh/decide/trial.hpp"

namespace {

using namespace itr;

/// A body in the middle of a step, pressed onto a plane where there is contact: what decides about an edit.
template <int Dim>
struct Step {
  Body<Dim> body;
  RemeshFields<Dim> fields;
  StepContext<Dim> context;
  Gate<Dim> gate;
  RemeshState<Dim> state;
  LocalScratch<Dim> scratch;
  Verdict<Dim> verdict;

  Step(int n, bool has_contact)
      : body(n),
        fields(make_fields(body)),
        context(make_context(n, has_contact)),
        gate(body.mesh, fields, context),
        state{body.mesh, fields, context, gate.present(), HistoryRule::function} {}

  static RemeshFields<Dim> make_fields(const Body<Dim>& body) {
    return {.x = body.x,
            .predictor = body.x,
            .velocity_reference = body.x,
            .past_positions = {body.x},
            .past_rates = {},
            .levels = {}};
  }
  static StepContext<Dim> make_context(int n, bool has_contact) {
    StepContext<Dim> context;
    context.materials[1] = {.youngs_modulus = 1e5, .poisson_ratio = 0.4, .density = 1000};
    context.scaling = 1e-4;
    context.newton.step_tolerance = 1e-9;
    if (!has_contact) return context;
    const double dhat = 0.1 / n;
    context.contact = {.enabled = true, .dhat = dhat, .convergent = true, .barrier_stiffness = 1e4};
    auto& obstacles = context.obstacles;
    if constexpr (Dim == 2) {
      obstacles.rest = {{-9, -dhat}, {9, -dhat}};
      obstacles.edges = {{0, 1}};
    } else {
      obstacles.rest = {{-9, -9, -dhat}, {9, -9, -dhat}, {0, 9, -dhat}};
      obstacles.triangles = {{0, 1, 2}};
      obstacles.edges = {{0, 1}, {1, 2}, {0, 2}};
    }
    obstacles.x = obstacles.velocity_reference = obstacles.rest;
    obstacles.past_x = {obstacles.x};
    return context;
  }
  /// As many around one place, whatever the size of the mesh: what is refined or coarsened lies together, so that the caches
  /// hold it. In contact those on the plane, of which the plane's meshes have fewer.
  std::vector<EdgeKey> edges() {
    const Mesh<Dim>& mesh = body.mesh;
    std::vector<EdgeKey> found = mesh.edges();
    const auto is_above = [&](const EdgeKey& e) { return mesh.rest(e[0])[Dim - 1] > 0 || mesh.rest(e[1])[Dim - 1] > 0; };
    if (context.contact.enabled) std::erase_if(found, is_above);
    Vec<Dim> place = Vec<Dim>::Constant(0.5);
    if (context.contact.enabled) place[Dim - 1] = 0;
    const auto away = [&](const EdgeKey& e) { return (mesh.rest(e[0]) + mesh.rest(e[1]) - 2 * place).squaredNorm(); };
    std::sort(found.begin(), found.end(), [&](const EdgeKey& a, const EdgeKey& b) { return away(a) < away(b); });
    const std::size_t most = Dim == 2 && context.contact.enabled ? 30 : 200;
    found.resize(std::min<std::size_t>(found.size(), most));
    std::shuffle(found.begin(), found.end(), body.random);
    return found;
  }
};

/// `decide` gets an edge, of which nothing is done.
template <int Dim>
void decide(benchmark::State& state, bool has_contact, auto&& decide) {
  Step<Dim> step(static_cast<int>(state.range(0)), has_contact);
  const auto edges = step.edges();
  for (const EdgeKey& edge : edges) benchmark::DoNotOptimize(decide(step, edge));  // warms up
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(decide(step, edges[i++ % edges.size()]));
  state.SetItemsProcessed(state.iterations());
}

template <int Dim>
double bound(Step<Dim>& step, const EdgeKey& edge) {
  return gain_of_vertex<Dim>(step.state, make_split(step.body.mesh, edge), step.scratch);
}
/// Gain of a trial of a patch of two rings, refused.
template <int Dim>
double trial(Step<Dim>& step, const EdgeKey& edge) {
  const auto edit = make_split(step.body.mesh, edge);
  preview<Dim>(step.state, step.gate, edit, {.required = 1e9, .local = {}}, step.scratch, step.verdict);
  return step.verdict.gain;
}

/// Whether a collapse keeps all stored configurations valid; what is asked are those that there are.
template <int Dim>
void check_collapse(benchmark::State& state, bool has_contact) {
  Step<Dim> step(static_cast<int>(state.range(0)), has_contact);
  std::vector<Edit<Dim>> edits;
  for (const EdgeKey& edge : step.edges())
    if (auto edit = propose_collapse(step.body.mesh, step.body.strata, edge).edit) edits.push_back(*edit);
  std::size_t i = 0;
  for (auto _ : state) benchmark::DoNotOptimize(step.gate.passes(edits[i++ % edits.size()], step.scratch.gate));
  state.SetItemsProcessed(state.iterations());
}

// Their names are those of the report: NOLINTBEGIN(readability-identifier-naming)

template <int Dim>
void PredictSplit(benchmark::State& state) {
  decide<Dim>(state, false, [](Step<Dim>& step, const EdgeKey& edge) { return predict_split<Dim>(step.state, edge); });
}
template <int Dim>
void BoundOfSplit(benchmark::State& state) {
  decide<Dim>(state, false, bound<Dim>);
}
template <int Dim>
void BoundOfSplitInContact(benchmark::State& state) {
  decide<Dim>(state, true, bound<Dim>);
}
template <int Dim>
void TrialOfSplit(benchmark::State& state) {
  decide<Dim>(state, false, trial<Dim>);
}
template <int Dim>
void TrialOfSplitInContact(benchmark::State& state) {
  decide<Dim>(state, true, trial<Dim>);
}
template <int Dim>
void CheckCollapse(benchmark::State& state) {
  check_collapse<Dim>(state, false);
}
template <int Dim>
void CheckCollapseInContact(benchmark::State& state) {
  check_collapse<Dim>(state, true);
}

/// Commits an accepted split: it changes the mesh, fields, strata, and the surface in each stored configuration; the
/// vertices of its cells move.
template <int Dim>
void accept(Step<Dim>& step, const EdgeKey& edge, Marks& moved) {
  Mesh<Dim>& mesh = step.body.mesh;
  if (!mesh.are_joined(edge[0], edge[1])) return;
  const auto edit = make_split(mesh, edge);
  const FacetId first_facet = mesh.facet_slots();
  const VertexId created = mesh.apply(edit);
  moved.clear(mesh.node_slots());
  step.fields.make_room(mesh.node_slots());
  step.fields.follow(edit, created);
  step.gate.follow(edit, first_facet);
  step.body.strata.follow(edit, created);
  step.gate.move(created);
  for (const CellId c : mesh.cells_of(created))
    for (const VertexId v : mesh.cell(c))
      if (moved.mark(v)) step.gate.move(v);
}

/// After a first round: arrays have room then. They grow by half, once in so many edits. As in a remeshing each edge is
/// tried before: looking through all edges for those of a round has taken what they need out of the caches of large meshes.
template <int Dim>
void AcceptSplit(benchmark::State& state) {
  Step<Dim> step(static_cast<int>(state.range(0)), true);
  Marks moved;
  for (const EdgeKey& edge : step.edges()) accept(step, edge, moved);
  std::vector<EdgeKey> edges;
  for (auto _ : state) {
    if (edges.empty()) {
      state.PauseTiming();
      edges = step.edges();
      for (const EdgeKey& edge : edges) trial(step, edge);
      state.ResumeTiming();
    }
    accept(step, edges.back(), moved);
    edges.pop_back();
  }
  state.SetItemsProcessed(state.iterations());
}

// 10^3, 10^4 and 10^5 vertices; so many times, since what leads there takes longer.
void plane(benchmark::internal::Benchmark* benchmark) { benchmark->Arg(31)->Arg(99)->Arg(315)->Iterations(4000); }
void space(benchmark::internal::Benchmark* benchmark) { benchmark->Arg(9)->Arg(21)->Arg(46)->Iterations(4000); }
BENCHMARK(PredictSplit<2>)->Apply(plane);
BENCHMARK(BoundOfSplit<2>)->Apply(plane);
BENCHMARK(BoundOfSplitInContact<2>)->Apply(plane);
BENCHMARK(TrialOfSplit<2>)->Apply(plane);
BENCHMARK(TrialOfSplitInContact<2>)->Apply(plane);
BENCHMARK(CheckCollapse<2>)->Apply(plane);
BENCHMARK(CheckCollapseInContact<2>)->Apply(plane);
BENCHMARK(AcceptSplit<2>)->Arg(31)->Arg(99)->Arg(315)->Iterations(200);
BENCHMARK(PredictSplit<3>)->Apply(space);
BENCHMARK(BoundOfSplit<3>)->Apply(space);
BENCHMARK(BoundOfSplitInContact<3>)->Apply(space);
BENCHMARK(TrialOfSplit<3>)->Apply(space);
BENCHMARK(TrialOfSplitInContact<3>)->Apply(space);
BENCHMARK(CheckCollapse<3>)->Apply(space);
BENCHMARK(CheckCollapseInContact<3>)->Apply(space);
BENCHMARK(AcceptSplit<3>)->Arg(9)->Arg(21)->Arg(46)->Iterations(1000);

// NOLINTEND(readability-identifier-naming)

}  // namespace
