// SPDX-License-Identifier: MIT
// Time of making an edit of a tetrahedral mesh, checks included, and of carrying it out, at 10^4, 10^5 and 10^6 cells. The
// argument is the number of cubes along a side, six cells each. Proposals are made at random places, so that at a million
// cells most of what they read comes from memory.
#include <benchmark/benchmark.h>

#include <chrono>

#include "bodies.hpp"

namespace {

using namespace itr;

void propose(benchmark::State& state, Body<3>& body, auto&& make) {
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
  Body<3> body(static_cast<int>(state.range(0)));
  propose(state, body, [&](const EdgeKey& edge) { return propose_split<3>(body.mesh, edge); });
}

void ProposeCollapse(benchmark::State& state) {
  Body<3> body(static_cast<int>(state.range(0)));
  propose(state, body, [&](const EdgeKey& edge) { return propose_collapse<3>(body.mesh, body.strata, edge); });
}

void ProposeEdgeRemoval(benchmark::State& state) {
  Body<3> body(static_cast<int>(state.range(0)));
  const CellCost cost = body.elastic_cost();
  propose(state, body, [&](const EdgeKey& edge) { return propose_edge_removal(body.mesh, body.strata, edge, cost); });
}

void ProposeFacetRemoval(benchmark::State& state) {
  Body<3> body(static_cast<int>(state.range(0)));
  propose(state, body, [&](const EdgeKey& edge) {
    const CellId c = body.mesh.cells_of(edge[0])[0];
    return propose_facet_removal(body.mesh, opposite_facet<3>(body.mesh.cell(c), edge[1] % 4));
  });
}

void ProposeMove(benchmark::State& state) {
  Body<3> body(static_cast<int>(state.range(0)));
  propose(state, body, [&](const EdgeKey& edge) {
    const Vec<3>&a = body.mesh.rest(edge[0]), &b = body.mesh.rest(edge[1]);
    return propose_move<3>(body.mesh, body.strata, edge[0], a + 0.1 * (b - a));
  });
}

/// Three Newton steps towards the best shape around a vertex.
void BestShapedPosition(benchmark::State& state) {
  Body<3> body(static_cast<int>(state.range(0)));
  propose(state, body, [&](const EdgeKey& edge) {
    benchmark::DoNotOptimize(best_shaped_position<3>(body.mesh, body.strata, edge[0], 3));
    return Proposal<3>{};
  });
}

/// Mesh::apply and Strata::follow alone, of all operations in turn; growth of the arrays included.
void ApplyEdit(benchmark::State& state) {
  Body<3> body(static_cast<int>(state.range(0)));
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

BENCHMARK(ProposeSplit)->Arg(12)->Arg(26)->Arg(55);
BENCHMARK(ProposeCollapse)->Arg(12)->Arg(26)->Arg(55);
BENCHMARK(ProposeEdgeRemoval)->Arg(12)->Arg(26)->Arg(55);
BENCHMARK(ProposeFacetRemoval)->Arg(12)->Arg(26)->Arg(55);
BENCHMARK(ProposeMove)->Arg(12)->Arg(26)->Arg(55);
BENCHMARK(BestShapedPosition)->Arg(12)->Arg(26)->Arg(55);
BENCHMARK(ApplyEdit)->Arg(12)->Arg(26)->Arg(55)->UseManualTime();

// NOLINTEND(readability-identifier-naming)

}  // namespace
