// SPDX-License-Identifier: MIT
// Whole runs with curved edges.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>

#include "random_tets.hpp"
#include "simulation/invariants.hpp"
#include "simulation/state.hpp"
#include "square_mesh.hpp"

namespace itr {

/// A bar of 4 x 1, clamped at x = 0, which weighs so much [m/s^2].
template <int Dim>
Setup<Dim> make_bar(double gravity) {
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
  setup.body_acceleration = [gravity](const Vec<Dim>&, double) { return Vec<Dim>(Vec<Dim>::Unit(1) * -gravity); };
  return setup;
}

template <int Dim>
struct Run {
  int splits = 0, curves = 0, straightens = 0, collapses = 0;
  int of_surface = 0;  ///< curved edges, in all of the steps
  double nearest = 1;
  State<Dim> state;
};

/// To its end; expects that each step succeeds, keeps its remeshing and is valid.
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
    for (const EdgeKey& edge : state.mesh.curved_edges()) result.of_surface += !state.mesh.facets_of_edge(edge).empty();
    for (const VectorX& x : state.history.x) EXPECT_EQ(find_violation(setup, state.mesh, x), "");
  }
  result.state = simulation.state();
  return result;
}

template <int Dim>
void expect_same(const State<Dim>& a, const State<Dim>& b) {
  ASSERT_EQ(a.mesh.num_vertices(), b.mesh.num_vertices());
  EXPECT_EQ(a.mesh.curved_edges(), b.mesh.curved_edges());
  EXPECT_EQ(a.history.x[0], b.history.x[0]);
  EXPECT_EQ(a.history.v[0], b.history.v[0]);
}

}  // namespace itr
