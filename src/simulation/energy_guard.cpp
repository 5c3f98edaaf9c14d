// SPDX-License-Identifier: MIT
#include "simulation/energy_guard.hpp"

#include <algorithm>
#include <cmath>

namespace itr {

template <int Dim>
EnergyGuard<Dim>::EnergyGuard(const StepSetup<Dim>& setup, const State<Dim>& start)
    : setup_(setup),
      is_on_(std::isfinite(setup.time.energy_growth_limit) && setup.time.integrator == Integrator::newmark),
      start_(start.created_energy),
      balance_(start.created_energy) {}

template <int Dim>
bool EnergyGuard<Dim>::allows(StepProblem<Dim>& problem, const History& history, const VectorX& x) {
  const TimeIntegrator integrator(setup_.time);
  const bool is_trapezoidal = integrator.is_trapezoidal(history);
  if (!is_on_ || !(is_trapezoidal || history.damp_next)) return true;
  const double created = problem.created_energy(history, x);
  const double before = problem.mechanical_energy(history.x[0], history.v[0]);
  // With the work that was done on the bodies, without what the step created.
  const double after = std::max(0.0, problem.mechanical_energy(x, integrator.velocity(x, history)) - created);
  // Energy that is dissipated or flows off takes along its share of what was created before.
  balance_ = created + start_ * (before > 0 ? std::min(1.0, after / before) : 1);
  if (!is_trapezoidal) {
    balance_ = std::max(0.0, balance_);  // what implicit Euler dissipates is no credit for later steps
    return true;
  }
  const double resolution = problem.energy_resolution();
  return created <= resolution || balance_ <= setup_.time.energy_growth_limit * (std::max(before, after) + resolution);
}

template class EnergyGuard<2>;
template class EnergyGuard<3>;

}  // namespace itr
