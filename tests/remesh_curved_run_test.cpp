// SPDX-License-Identifier: MIT
// Whole runs with curved edges: they choose the order, keep momentum in free flight, and do with one of two operations.
#include <gtest/gtest.h>

#include "core/parallel.hpp"
#include "curved_mesh.hpp"
#include "curved_run.hpp"
#include "energy/inertia.hpp"

namespace itr {
namespace {

template <typename T>
class CurvedRun : public ::testing::Test {};
using Dimensions = ::testing::Types<std::integral_constant<int, 2>, std::integral_constant<int, 3>>;
TYPED_TEST_SUITE(CurvedRun, Dimensions);

/// A bending bar without contact.
template <int Dim>
Setup<Dim> bar() {
  Setup<Dim> setup = make_bar<Dim>(2);
  setup.time.dt = 0.02;
  setup.time.steps = 6;
  setup.remesh.enabled = true;
  setup.remesh.split.acceptance_tolerance = Dim == 2 ? 0.01 : 0.02;
  setup.remesh.collapse.rel_max_edge_length = 2;
  setup.remesh.swap.enabled = setup.remesh.smooth.enabled = true;
  return setup;
}

TYPED_TEST(CurvedRun, RunsChooseTheOrderToo) {
  constexpr int Dim = TypeParam::value;
  Setup<Dim> setup = bar<Dim>();
  setup.remesh.curve.enabled = setup.remesh.straighten.enabled = true;
  setup.remesh.collapse.acceptance_tolerance = -0.1 * *setup.remesh.split.acceptance_tolerance;
  const Run<Dim> both = run<Dim>(setup);
  EXPECT_GT(both.curves, 5);
  EXPECT_GT(both.collapses, 0);
  EXPECT_EQ(both.state.mesh.num_curved() > 0, true);
  for (const int threads : {1, 3}) {
    const ThreadLimit limit(threads);
    expect_same(run<Dim>(setup).state, both.state);
  }
}

/// All operations at curved edges: the projection of the history keeps momentum.
TYPED_TEST(CurvedRun, RunsInFreeFlightKeepMomentum) {
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
    const CellSet<Dim> cells = whole_mesh(state.mesh, {});
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
TYPED_TEST(CurvedRun, RunsWithOneOfTheTwo) {
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
  EXPECT_TRUE(is_all_curved(split.state.mesh));
}

}  // namespace
}  // namespace itr
