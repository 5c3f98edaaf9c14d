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
  /// much faster than a step, it can create energy without bound. A step that creates some, after which the energy created
  /// so far would exceed this part of the mechanical energy (kinetic, elastic and contact; the larger of those before and
  /// after the step), is taken by implicit Euler instead. Work of loads, held vertices and obstacles is not created.
  /// Infinity: never.
  double energy_growth_limit = 0.05;
  bool quasistatic = false;  ///< no inertia
  bool is_static = false;    ///< one equilibrium at t0 + dt, 1 by default; alpha = 1
  /// A step whose solve fails is cut into two of half its length, and these again, so many times; 0: the simulation stops.
  /// In BDF and Newmark the smaller steps are of implicit Euler, and BDF's order grows again from 1 after them.
  int step_cuts = 0;
  double t0 = 0;       ///< [s]
  double dt = 1;       ///< h [s]
  int steps = 1;       ///< number of steps
  int first_step = 0;  ///< after which it is t0: steps after it have the length dt, those before it had others

  bool has_inertia() const { return !quasistatic && !is_static; }
  double time_after(int step) const { return t0 + (step - first_step) * dt; }  ///< [s]
};

}  // namespace itr
