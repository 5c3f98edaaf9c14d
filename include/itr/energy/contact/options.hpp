// SPDX-License-Identifier: MIT
#pragma once

namespace itr {

/// Contact and friction (IPC). docs/theory.md, "Contact", has the exact sums.
struct ContactOptions {
  bool enabled = false;
  double dhat = 1e-3;                ///< [m]: the barrier acts below it; 0: as Setup::choose_defaults says
  bool convergent = false;           ///< area weights, duplicate-region correction, 1/dhat^3: kappa is a pressure [Pa]
  double barrier_stiffness = 0;      ///< kappa; 0: as Setup::choose_defaults says
  bool adaptive_stiffness = false;   ///< from barrier_stiffness on as docs/theory.md, "Barrier stiffness", says
  double friction_coefficient = 0;   ///< mu
  double friction_velocity = 1e-3;   ///< eps_v [m/s]: below it friction is smoothed; 0: chosen (Setup)
  int friction_iterations = 1;       ///< most lagging rounds a step; negative: no limit; 0: no friction
  double friction_tolerance = 1e-2;  ///< rounds end when the re-lagged gradient norm is below this * h
};

}  // namespace itr
