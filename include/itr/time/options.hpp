// SPDX-License-Identifier: MIT
#pragma once

namespace itr {

enum class Integrator { implicit_euler, newmark, bdf };

struct TimeOptions {
  Integrator integrator = Integrator::implicit_euler;
  int bdf_order = 2;           ///< 1..6, for Integrator::bdf
  double newmark_beta = 0.25;  ///< for Integrator::newmark
  double newmark_gamma = 0.5;
  /// Newmark with beta 1/4 and gamma 1/2 keeps energy only to the order of the step: where contact or near-inversion is
  /// much faster than a step, it can create energy without bound. A step after which the energy created so far would exceed
  /// this part of the mechanical energy is taken by implicit Euler instead. Infinity: never.
  double energy_growth_limit = 0.05;
  bool quasistatic = false;  ///< no inertia
  bool is_static = false;    ///< one equilibrium at t = 1; alpha = 1
  double t0 = 0;             ///< [s]
  double dt = 1;             ///< h [s]
  int steps = 1;             ///< number of steps
};

}  // namespace itr
