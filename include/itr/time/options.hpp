// SPDX-License-Identifier: MIT
#pragma once

namespace itr {

enum class Integrator { implicit_euler, newmark, bdf };

struct TimeOptions {
  Integrator integrator = Integrator::implicit_euler;
  int bdf_order = 2;           ///< 1..6, for Integrator::bdf
  double newmark_beta = 0.25;  ///< for Integrator::newmark
  double newmark_gamma = 0.5;
  bool quasistatic = false;  ///< no inertia
  bool is_static = false;    ///< one equilibrium at t = 1; alpha = 1
  double t0 = 0;             ///< [s]
  double dt = 1;             ///< h [s]
  int steps = 1;             ///< number of steps
};

}  // namespace itr
