// SPDX-License-Identifier: MIT
#include "simulation/time_bars.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace itr {

namespace {
/// Part of the mechanical energy that an impact may take: motions after a larger one depend on when it was.
constexpr double kLostByImpact = 1e-3;
constexpr double kRoundOff = 1e-16;  ///< of the mechanical energy
/// Errors that leading terms tell: of so many radians a step, which have put oscillations off by so many radians.
struct Slow {
  double fastest, most_turn;
};
constexpr Slow kDisplacements{0.5, 1}, kForces{0.3, 0.5};
}  // namespace

template <int Dim>
void TimeBars<Dim>::find(const StepSetup<Dim>& setup, const State<Dim>& state, StepProblem<Dim>& problem, const VectorX& x,
                         const Filter& filter, SourceChange& change) {
  const TimeIntegrator integrator(setup.time);
  const History& history = state.history;
  local_ = {};
  if (!setup.time.has_inertia()) {
    knows_displacements_ = knows_forces_ = !setup.depends_on_path();
    return;
  }
  const VectorX increment = problem.increment_of(x);
  TimeErrors contact;
  const VectorX acted_on = problem.contact_in_step(history, x, contact);
  energy_ = problem.mechanical_energy(x, integrator.velocity_after(increment, history));
  const bool has_errors = history.dt == 0 || carried_.are_of(history, state.mesh.revision());
  are_lost_ = are_lost_ || !has_errors || contact.impact > kLostByImpact * energy_ || !integrator.knows_local_error(history);
  if (are_lost_) return;
  History with_accelerations = history;
  if (!accelerations_.empty()) with_accelerations.a = accelerations_;
  local_ = integrator.local_error(increment, with_accelerations);
  if (!filter_local_errors(problem, acted_on, integrator.velocity_rate(history), filter)) return lose();
  const History exact = carried_.added_to(history, history, state.mesh.revision());
  of_predictor_ = integrator.predictor_error(local_, history) + integrator.predictor(exact) - integrator.predictor(history);
  const VectorX momentum = problem.momentum(of_predictor_);
  change.all = -momentum;
  change.energy = -(x - integrator.predictor(history)).dot(momentum);
}

template <int Dim>
bool TimeBars<Dim>::filter_local_errors(const StepProblem<Dim>& problem, const VectorX& acted_on, double velocity_rate,
                                        const Filter& filter) {
  const std::vector<int>& unknown = problem.dofs().unknown;
  for (VectorX* error : {&local_.x, &local_.v}) {
    if (error->size() == 0) continue;
    for (Eigen::Index i = 0; i < error->size(); ++i)  // accelerations of nodes that contact acts on jump
      if (unknown[i] == kNone || (acted_on.size() > 0 && acted_on[i] != 0)) (*error)[i] = 0;
    VectorX resolved = filter(problem.momentum(*error));
    if (resolved.size() == 0) return false;
    const VectorX rest = (error == &local_.x ? velocity_rate : 1) * (*error - resolved);
    unresolved_ += 0.5 * rest.dot(problem.momentum(rest));
    *error = std::move(resolved);
  }
  return true;
}

/// Errors e turn with w^2 = e.Ke/e.Me, forces Ke with w^2 = Ke.M^-1 Ke/e.Ke, where alpha h^2 K e = M (of_predictor_ - e). In
/// a time t leading terms are off by C (wh)^(p+1) t/h radians.
template <int Dim>
void TimeBars<Dim>::judge(const StepSetup<Dim>& setup, const History& history, const StepProblem<Dim>& problem,
                          const VectorX& motion) {
  const TimeIntegrator integrator(setup.time);
  const double h = setup.time.dt, scaling = problem.scaling(), alpha = scaling / (h * h);
  const VectorX rest = of_predictor_ - motion, momentum = problem.momentum(rest);
  const double kinetic = motion.dot(problem.momentum(motion)), elastic = motion.dot(momentum), fast = rest.dot(momentum);
  const auto is_slow = [&](double wh, const Slow& bounds) {
    const double turn = integrator.error_constant(history) * std::pow(wh, integrator.accuracy(history) + 1) * elapsed_ / h;
    return wh <= bounds.fastest && turn <= bounds.most_turn;
  };
  knows_displacements_ = knows_forces_ = true;
  if (kinetic <= 2 * h * h * kRoundOff * energy_) return;
  // Errors that leading terms do not tell any more may be damped in the solution, and yet stay.
  const auto knows = [](bool is_told, double size, double& untold) {
    if (!is_told) untold = std::max(untold, size);
    return is_told && size >= untold;
  };
  knows_displacements_ = knows(is_slow(std::sqrt(std::max(0.0, elastic) / (alpha * kinetic)), kDisplacements),
                               kinetic / (2 * h * h), untold_displacement_) &&
                         kinetic >= 2 * unresolved_ * h * h;
  knows_forces_ = knows(elastic > 0 && is_slow(std::sqrt(fast / (alpha * elastic)), kForces),
                        std::max(0.0, elastic) / (2 * scaling), untold_force_) &&
                  elastic >= 2 * unresolved_ * scaling;
}

template <int Dim>
void TimeBars<Dim>::keep(const StepSetup<Dim>& setup, const State<Dim>& state, const StepProblem<Dim>& problem,
                         const VectorX& x, const VectorX& motion) {
  if (are_lost_ || local_.x.size() == 0) {
    carried_ = {};
    accelerations_.clear();
    return;
  }
  const TimeIntegrator integrator(setup.time);
  const History& history = state.history;
  elapsed_ += setup.time.dt;
  judge(setup, history, problem, motion);
  History errors = difference(carried_.added_to(history, history, state.mesh.revision()), history);
  errors.dt = history.dt;
  integrator.push_errors(motion, local_, errors);
  carried_ = {state.mesh.revision(), x, std::move(errors)};
  accelerations_.insert(accelerations_.begin(), integrator.acceleration(integrator.velocity(x, history), history));
  accelerations_.resize(std::min<std::size_t>(accelerations_.size(), 2));
}

#define ITR_INSTANTIATE(Dim) template class TimeBars<Dim>;
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
