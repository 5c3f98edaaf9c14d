// SPDX-License-Identifier: MIT
// A block that weighs, and a table to put it on.
#pragma once

#include <cmath>

#include "simulation/state.hpp"
#include "square_mesh.hpp"

namespace itr {

inline constexpr double kGravity = 10, kDensity = 1000, kSize = 0.2;

template <int Dim>
Mesh<Dim> make_block();

template <>
inline Mesh<2> make_block<2>() {
  const Grid grid = make_regular_grid(3, kSize, [](int, int) { return true; });
  return Mesh<2>(grid.rest, grid.cells, std::vector<int>(grid.cells.size(), 1));
}

/// A cube of six tetrahedra around its diagonal.
template <>
inline Mesh<3> make_block<3>() {
  std::vector<Vec<3>> rest;
  for (int i = 0; i < 8; ++i) rest.emplace_back(kSize * (i & 1), kSize * (i >> 1 & 1), kSize * (i >> 2 & 1));
  const std::vector<std::array<int, 4>> cells = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7},
                                                 {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
  return Mesh<3>(rest, cells, std::vector<int>(6, 1));
}

template <int Dim>
Setup<Dim> block() {
  Setup<Dim> setup;
  setup.mesh = make_block<Dim>();
  for (int f = 0; f < setup.mesh.facet_slots(); ++f) {  // 1: left, 2: top, 3: others
    double left = 0, top = 0;
    for (const int v : setup.mesh.facet(f)) {
      left = std::max(left, setup.mesh.rest(v)[0]);
      top = std::max(top, kSize - setup.mesh.rest(v)[1]);
    }
    setup.mesh.set_facet_tag(f, left < 1e-9 ? 1 : top < 1e-9 ? 2 : 3);
  }
  setup.materials[1] = {.youngs_modulus = 1e5, .poisson_ratio = 0.3, .density = kDensity};
  setup.body_acceleration = [](const Vec<Dim>&, double) { return Vec<Dim>(-kGravity * Vec<Dim>::Unit(1)); };
  setup.time = {.dt = 0.01, .steps = 10};
  setup.newton.step_tolerance = 1e-11;
  setup.newton.gradient_tolerance = setup.newton.first_gradient_tolerance = 1e-12;
  setup.fields = {true, true, true, true, true, true, true};
  return setup;
}

template <int Dim>
double weight() {
  return kDensity * kGravity * std::pow(kSize, Dim);
}

/// A table half a d-hat below the block.
template <int Dim>
void add_table(Setup<Dim>& setup) {
  constexpr double dhat = 1e-3;
  const double y = -dhat / 2;
  auto& table = setup.obstacles;
  if constexpr (Dim == 2) {
    table.rest = {{-1, y}, {1, y}};
    table.edges = {{0, 1}};
  } else {
    table.rest = {{-1, y, -1}, {1, y, -1}, {1, y, 1.1}, {-1, y, 1}};
    table.triangles = {{0, 2, 1}, {0, 3, 2}};
  }
  table.motion.assign(table.rest.size(), kNone);
  setup.contact = {.enabled = true, .dhat = dhat, .convergent = true, .barrier_stiffness = 1e6};
}

/// The block as it lands on the table, at 2 m/s along it.
template <int Dim>
Setup<Dim> sliding_block(int friction_iterations) {
  Setup<Dim> setup = block<Dim>();
  add_table(setup);
  setup.contact.friction_coefficient = 0.3;
  setup.contact.friction_iterations = friction_iterations;
  setup.initial_velocity.push_back({1, [](const Vec<Dim>&, double) { return Vec<Dim>(2 * Vec<Dim>::Unit(0)); }});
  return setup;
}

template <int Dim>
AskedFields asked(const Simulation<Dim>& simulation) {
  AskedFields fields;
  simulation.observe([&](const FrameView<Dim>& frame) { fields = *frame.asked; });
  return fields;
}

template <int Dim>
Vec<Dim> sum(const VectorX& field) {
  Vec<Dim> total = Vec<Dim>::Zero();
  for (Eigen::Index i = 0; i < field.size(); i += Dim) total += field.segment<Dim>(i);
  return total;
}

}  // namespace itr
