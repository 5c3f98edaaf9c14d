// SPDX-License-Identifier: MIT
// Simulations of a program that embeds the library.
#pragma once

#include <utility>

#include "block.hpp"

namespace itr {

template <int Dim>
Simulation<Dim> simulate(Setup<Dim> setup) {
  static linear::Registry registry;
  return Simulation<Dim>(std::move(setup), registry);
}

/// A block that is pressed down on its top by a wall, and refined where that helps.
inline Setup<2> pressed_block() {
  auto setup = block<2>();
  setup.time = {.dt = 0.01, .steps = 1000};
  setup.dirichlet.push_back({2, {true, true}, [](const Vec<2>&, double t) { return Vec<2>(0.3 * t, -0.6 * t); }});
  add_table(setup);
  setup.remesh.enabled = true;
  setup.remesh.split.acceptance_tolerance = 1e-4;
  setup.remesh.collapse.acceptance_tolerance = -1e-6;
  setup.remesh.swap.enabled = true;
  setup.remesh.smooth.enabled = true;
  return setup;
}

}  // namespace itr
