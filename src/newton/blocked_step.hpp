// SPDX-License-Identifier: MIT
#pragma once

#include "itr/newton/newton.hpp"

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

/// Turns a Newton step of which only `share` is free, so that pairs that stop it keep a gap at its end: the minimum of the
/// model under bounds on their linearised gaps (an active set, as in sequential quadratic programming). Returns the
/// share of `step` that is free then; both stay as they are where the model gains no more along the turned step.
double turn_blocked_step(const StepOrigin& origin, VectorView step, double share);

}  // namespace itr
