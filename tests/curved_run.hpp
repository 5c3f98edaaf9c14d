// SPDX-License-Identifier: MIT
// Whole runs with curved edges.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>

#include "itr/simulation/simulation.hpp"
#include "simulation/invariants.hpp"

namespace itr {

template <int Dim>
struct Run {
  int splits = 0, curves = 0, straightens = 0, collapses = 0;
  int of_surface = 0;  ///< curved edges, in all of the steps
  double nearest = 1;
  State<Dim> state;
};

/// To its end; expects that each step succeeds, keeps its mesh and is valid.
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
    result.straightens += step.report.straightens.accepted;
    result.collapses += step.report.collapses.accepted;
    result.nearest = std::min(result.nearest, step.report.min_distance);
    EXPECT_EQ(step.report.reverted_remeshes, 0);
    const State<Dim>& state = simulation.state();
    for (const EdgeKey& edge : state.space.curved_edges()) result.of_surface += !state.mesh.facets_of_edge(edge).empty();
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

}  // namespace itr
