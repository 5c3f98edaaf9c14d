// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>

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
  EnergyGuard(const StepSetup<Dim>& setup, const State<Dim>& start)
      : setup_(setup),
        is_on_(std::isfinite(setup.time.energy_growth_limit) && setup.time.integrator == Integrator::newmark),
        start_(start.created_energy),
        balance_(start.created_energy) {}
  /// Whether the step from `history`, which `problem` describes, may end at x. Always, where implicit Euler takes it.
  bool allows(StepProblem<Dim>& problem, const History& history, const VectorX& x) {
    const TimeIntegrator integrator(setup_.time);
    const bool is_trapezoidal = integrator.is_trapezoidal(history);
    if (!is_on_ || !(is_trapezoidal || history.damp_next)) return true;
    const double created = problem.created_energy(history, x);
    const double before = problem.mechanical_energy(history.x[0], history.v[0]);
    // With the work that was done on the bodies, without what the step created.
    const double after = std::max(0.0, problem.mechanical_energy(x, integrator.velocity(x, history)) - created);
    // Energy that is dissipated or flows off takes along its fraction of what was created before.
    balance_ = created + start_ * (before > 0 ? std::min(1.0, after / before) : 1);
    if (!is_trapezoidal) {
      balance_ = std::max(0.0, balance_);  // what implicit Euler dissipates is no credit for later steps
      return true;
    }
    const double resolution = problem.energy_resolution();
    return created <= resolution || balance_ <= setup_.time.energy_growth_limit * (std::max(before, after) + resolution);
  }
  /// The balance at the end of the step that was last asked about [J].
  double created_energy() const { return balance_; }

 private:
  const StepSetup<Dim>& setup_;
  bool is_on_;
  double start_;    ///< the balance before the step [J]
  double balance_;  ///< and at its end [J]
};

}  // namespace itr
