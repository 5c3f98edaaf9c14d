// SPDX-License-Identifier: MIT
// Bodies whose boundary moves by a given deformation, for tests of laws that remember.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <random>

#include "advance.hpp"
#include "energy/cell_field.hpp"
#include "itr/solver.hpp"
#include "random_cube.hpp"
#include "random_mesh.hpp"
#include "simulation/cell_stress.hpp"
#include "simulation_scenes.hpp"

namespace itr {

template <int Dim>
Mesh<Dim> body(int n) {
  if constexpr (Dim == 2) return make_square(n, 1);
  std::mt19937 random(3);
  Mesh<Dim> mesh = [&] {
    if constexpr (Dim == 3)
      return make_cube(n, random, 0.1);
    else
      return make_square(n, 1);
  }();
  for (FacetId f = 0; f < mesh.facet_slots(); ++f) mesh.set_facet_tag(f, 1);
  return mesh;
}

template <int Dim>
using Motion = std::function<Mat<Dim>(double t)>;

/// A body whose boundary moves by F(t), from F(0) at once; without inertia.
template <int Dim>
Setup<Dim> driven(const Material& material, const Motion<Dim>& F, double dt, int steps, int order = 1) {
  Setup<Dim> setup;
  setup.mesh = body<Dim>(2);
  setup.order[1] = order;
  setup.materials[1] = material;
  const auto displacement = [F](const Vec<Dim>& X, double t) { return Vec<Dim>(F(t) * X - X); };
  for (const int tag : {1, 2, 3, 4}) {
    DirichletCondition<Dim> condition{tag, {}, displacement};
    condition.components.fill(true);
    setup.dirichlet.push_back(condition);
  }
  setup.initial_displacement.push_back({1, displacement});
  setup.time = {.quasistatic = true, .dt = dt, .steps = steps};
  setup.newton.step_tolerance = 0;
  setup.newton.gradient_tolerance = setup.newton.first_gradient_tolerance = 1e-11;
  return setup;
}

template <int Dim>
Mat<Dim> stress_in(const Simulation<Dim>& simulation, std::size_t cell = 0) {
  const auto stress = cell_stress(simulation).cauchy;
  return Eigen::Map<const Mat<Dim>>(&stress.at(cell * Dim * Dim)).transpose();  // rows are stored
}

template <int Dim>
Mat<Dim> sheared() {
  Mat<Dim> F = Mat<Dim>::Identity();
  F(0, 0) = 1.3;
  F(1, 1) = 0.8;
  F(0, 1) = 0.4;
  return F;
}

/// Bodies of a material that fall, whose mesh changes: they lose energy, and their state is one of the present mesh.
inline void expect_memory_where_meshes_change(const Material& material, double StepReport::*lost,
                                              std::shared_ptr<const CellHistory> History::*state) {
  auto setup = impact();
  setup.materials[1] = material;
  setup.time.steps = 20;
  enable_remeshing(setup);
  linear::Registry registry;
  Simulation<2> simulation(setup, registry);
  int splits = 0;
  double sum = 0;
  for (int k = 0; k < 12; ++k) {
    const StepReport report = advance(simulation).report;
    splits += report.splits.accepted;
    EXPECT_GE(report.history_loss, 0);
    EXPECT_GE(report.*lost, 0);
    sum += report.*lost;
    const auto& field = dynamic_cast<const CellField<2>&>(*(simulation.state().history.*state));
    EXPECT_EQ(static_cast<int>(field.by_cell().size()), simulation.state().mesh.cell_slots());
  }
  EXPECT_GT(splits, 0);
  EXPECT_GT(sum, 0);
  expect_valid(simulation);
}

template <int Dim>
VectorX moved(const Mesh<Dim>& mesh, double size, std::mt19937& random) {
  std::uniform_real_distribution<double> shift(-size, size);
  VectorX x(Dim * mesh.num_nodes());
  for (int v = 0; v < mesh.num_nodes(); ++v)
    for (int c = 0; c < Dim; ++c) x[Dim * v + c] = mesh.point_of_node(v)[c] + shift(random);
  return x;
}

}  // namespace itr
