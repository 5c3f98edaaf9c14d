// SPDX-License-Identifier: MIT
#pragma once

#include "simulation/state.hpp"
#include "simulation/step_problem.hpp"

namespace itr {

/// Holds the steps of the trapezoidal rule to TimeOptions::energy_growth_limit, and keeps the balance of what they create
/// (State::created_energy). Work of loads, held vertices and obstacles is not created: it adds to the energy that the limit
/// is a part of.
template <int Dim>
class EnergyGuard {
 public:
  /// Guards a step that starts from `start`. `setup` must outlive this.
  EnergyGuard(const StepSetup<Dim>& setup, const State<Dim>& start);
  /// Whether the step from `history`, which `problem` describes, may end at x. Always, where implicit Euler takes it.
  bool allows(StepProblem<Dim>& problem, const History& history, const VectorX& x);
  /// The balance at the end of the step that was last asked about [J].
  double created_energy() const { return balance_; }

 private:
  const StepSetup<Dim>& setup_;
  bool is_on_;
  double start_;    ///< the balance before the step [J]
  double balance_;  ///< and at its end [J]
};

}  // namespace itr
