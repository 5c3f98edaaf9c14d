// SPDX-License-Identifier: MIT
// Scenes of one square that the tests of whole steps share.
#pragma once

#include <gtest/gtest.h>

#include <ostream>

#include "fem/inverted.hpp"
#include "simulation/contact_surface.hpp"
#include "simulation/state.hpp"
#include "square_mesh.hpp"

namespace itr {

inline void PrintTo(const TimeOptions& time, std::ostream* out) {
  constexpr const char* kNames[] = {"ImplicitEuler", "ImplicitNewmark", "BDF"};
  *out << kNames[static_cast<int>(time.integrator)];
  if (time.integrator == Integrator::bdf) *out << time.bdf_order;
}

/// Diagonals alternate.
inline Mesh<2> make_square(int n, double size) {
  const Grid grid = make_regular_grid(n, size, [](int i, int j) { return (i + j) % 2; });
  Mesh<2> mesh(grid.rest, grid.cells, std::vector<int>(grid.cells.size(), 1));
  tag_sides(mesh, size);
  return mesh;
}

inline Setup<2> free_square(int n) {
  Setup<2> setup;
  setup.mesh = make_square(n, 0.2);
  setup.materials[1] = {.youngs_modulus = 1e4, .poisson_ratio = 0.4, .density = 1000};
  setup.time = {.dt = 0.01, .steps = 10};
  setup.newton.step_tolerance = 1e-10;
  setup.newton.gradient_tolerance = setup.newton.first_gradient_tolerance = 1e-14;
  return setup;
}

/// A soft square thrown onto a line.
inline Setup<2> impact() {
  auto setup = free_square(4);
  setup.obstacles.rest = {{-1, -0.01}, {1, -0.011}};
  setup.obstacles.edges = {{0, 1}};
  setup.obstacles.motion = {kNone, kNone};
  setup.contact = {.enabled = true, .dhat = 2e-3, .convergent = true, .barrier_stiffness = 1e4, .friction_coefficient = 0.2};
  setup.initial_velocity.push_back({1, [](const Vec<2>&, double) { return Vec<2>(0.3, -2); }});
  setup.newton.step_tolerance = 1e-7;
  setup.newton.gradient_tolerance = 1e-10;
  return setup;
}

inline void enable_remeshing(Setup<2>& setup) {
  setup.remesh.enabled = true;
  setup.remesh.split.acceptance_tolerance = 1e-4;
  setup.remesh.split.culling_threshold = 0.8;
  setup.remesh.collapse.acceptance_tolerance = -1e-4;
  setup.remesh.collapse.culling_threshold = 0.1;
  setup.remesh.collapse.rel_max_edge_length = 3;
  setup.remesh.swap.enabled = setup.remesh.smooth.enabled = true;
  setup.remesh.swap.acceptance_tolerance = setup.remesh.smooth.acceptance_tolerance = -1e-5;
}

inline void expect_valid(const Simulation<2>& simulation) {
  const auto& state = simulation.state();
  EXPECT_EQ(state.mesh.find_defect(), "");
  EXPECT_NEAR(state.mesh.total_volume(), 0.04, 1e-15);
  for (const VectorX& x : state.history.x) {
    EXPECT_EQ(find_inverted<2>(state.mesh, x), kNone);
    const CollisionSurface surface = collision_surface(state.mesh, simulation.setup().obstacles);
    EXPECT_FALSE(has_intersection<2>(surface, x)) << "step " << state.step;
  }
}

}  // namespace itr
