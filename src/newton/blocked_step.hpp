// SPDX-License-Identifier: MIT
#pragma once

#include "newton/newton.hpp"

namespace itr {

/// Where a step begins, and the Newton system that it solves.
struct StepOrigin {
  const Energy& energy;
  ConstVectorView x;
  const DofMap& dofs;
  ConstVectorView gradient;
  NewtonSystem& system;
  Workspace& workspace;
};

/// Turns a Newton step of which only `share` is free, so that the pairs that stop it keep a gap at its end. The turned step
/// is the minimum of the quadratic model under bounds on linearised gaps (an active set, as in sequential quadratic
/// programming). Returns the free share of `step`; both stay unchanged if the model gains no more along the turned step.
double turn_blocked_step(const StepOrigin& origin, VectorView step, double share);

}  // namespace itr
