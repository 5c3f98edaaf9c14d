// SPDX-License-Identifier: MIT
// The problem of one step: what problems fraction of a cache belongs to whichever solves.
#include "simulation/step_problem.hpp"

#include <gtest/gtest.h>

#include "itr/solver.hpp"
#include "square_mesh.hpp"

namespace itr {
namespace {

itr::Setup<2> square_of(int cells, double moved) {
  const Grid grid = make_regular_grid(cells, 1, [](int i, int j) { return (i + j) % 2; });
  itr::Setup<2> setup;
  setup.mesh = Mesh<2>(grid.rest, grid.cells, std::vector<int>(grid.cells.size(), 1));
  tag_sides(setup.mesh, 1);
  setup.materials[1] = {.youngs_modulus = 1e4, .poisson_ratio = 0.3, .density = 1000};
  setup.time = {.quasistatic = true, .dt = 0.1, .steps = 1};
  setup.newton.step_tolerance = 1e-12;
  setup.newton.gradient_tolerance = setup.newton.first_gradient_tolerance = 0;
  setup.dirichlet = {{1, {true, true}, [](const Vec<2>&, double) { return Vec<2>(0, 0); }},
                     {3, {true, true}, [moved](const Vec<2>&, double) { return Vec<2>(moved, 0); }}};
  return setup;
}

History at_rest(const Mesh<2>& mesh) {
  History history;
  history.x = {VectorX(2 * mesh.node_slots())};
  for (VertexId v = 0; v < mesh.node_slots(); ++v) history.x[0].segment<2>(2 * v) = mesh.rest(v);
  history.v = {VectorX::Zero(2 * mesh.node_slots())};
  return history;
}

/// A remeshed step has two at a time: that on the mesh before comes back where the new mesh fails.
TEST(StepProblem, SolvesAsIfAloneWhereAnotherHasTheCacheToo) {
  linear::Registry registry;
  const auto solver = registry.create("eigen");
  const itr::Setup<2> coarse = square_of(3, 0.1), fine = square_of(6, 0.1);
  const History of_coarse = at_rest(coarse.mesh), of_fine = at_rest(fine.mesh);
  ProblemCache<2> own(*solver);
  VectorX expected = of_coarse.x[0];
  ASSERT_TRUE(StepProblem<2>(coarse, coarse.mesh, of_coarse, 0.1, own).solve(expected, expected).converged());

  ProblemCache<2> cache(*solver);
  StepProblem<2> before(coarse, coarse.mesh, of_coarse, 0.1, cache);
  StepProblem<2> after(fine, fine.mesh, of_fine, 0.1, cache);
  VectorX x = of_fine.x[0];
  ASSERT_TRUE(after.solve(x, x).converged());
  x = of_coarse.x[0];
  ASSERT_TRUE(before.solve(x, x).converged());
  EXPECT_EQ(x, expected);
}

}  // namespace
}  // namespace itr
