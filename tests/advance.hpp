// SPDX-License-Identifier: MIT
// Steps that must succeed: a step that fails ends its test.
#pragma once

#include <stdexcept>

#include "itr/simulation.hpp"

namespace itr {

template <int Dim>
StepResult advance(Simulation<Dim>& simulation) {
  StepResult result = simulation.advance();
  if (!result.ok) throw std::runtime_error(result.reason);
  return result;
}

}  // namespace itr
