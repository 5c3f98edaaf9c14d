// SPDX-License-Identifier: MIT
// Errors in time of a step that is solved (docs/theory.md, "Adaptive time").
#include <algorithm>
#include <limits>

#include "energy/incremental_potential.hpp"
#include "simulation/step_problem.hpp"

namespace itr {

/// Energy of an error e in time once the step has filtered it, (M + alpha h^2 K) f = M e: motion that is faster than a
/// step, such as that of a barrier, is damped anyway.
template <int Dim>
double StepProblem<Dim>::local_error_energy(const History& history, const VectorX& increment) {
  const TimeIntegrator integrator(setup_.time);
  const int unknowns = dofs_.num_unknowns;
  const auto of_unknowns = [&](const VectorX& field) {
    VectorX values(unknowns);
    for (Eigen::Index i = 0; i < field.size(); ++i)
      if (dofs_.unknown[i] != kNone) values[dofs_.unknown[i]] = field[i];
    return values;
  };
  const auto mass_product = [&](const VectorX& values) {
    VectorX field = VectorX::Zero(increment.size());
    for (Eigen::Index i = 0; i < field.size(); ++i)
      if (dofs_.unknown[i] != kNone) field[i] = values[dofs_.unknown[i]];
    return of_unknowns(momentum(field));
  };
  if (!terms_.has_inertia) {
    const double h = setup_.time.dt, chord = 4 * (1 + history.dt / h);
    const VectorX d = of_unknowns((increment - h * history.v[0]) / chord);
    VectorX force(unknowns);
    system().product()(d, force);
    return 0.5 * std::max(0.0, d.dot(force)) / terms_.scaling;
  }
  const LocalError error = integrator.local_error(increment, history);
  const bool has_velocity = error.v.size() > 0;
  MatrixX B(unknowns, has_velocity ? 2 : 1), filtered;
  B.col(0) = mass_product(of_unknowns(error.x));
  if (has_velocity) B.col(1) = mass_product(of_unknowns(error.v));
  if (!system().solve_columns(B, filtered)) return std::numeric_limits<double>::quiet_NaN();
  double energy = std::max(0.0, filtered.col(0).dot(B.col(0) - mass_product(filtered.col(0)))) / (2 * terms_.scaling);
  if (has_velocity) energy += 0.5 * filtered.col(1).dot(mass_product(filtered.col(1)));
  return energy;
}

/// Nodes that no contact force acted on before the step, and that one has stopped in its direction.
template <int Dim>
void StepProblem<Dim>::find_impact(const History& history, const VectorX& x, const VectorX& v, TimeErrors& errors) {
  const VectorX &x0 = history.x[0], &v0 = history.v[0];
  VectorX before = VectorX::Zero(x.size()), now = before, stopped = before;
  potential_.contact_of_cells()->add_gradient(x, now, workspace_);
  potential_.contact_of_cells()->add_gradient(x0, before, workspace_);
  double fastest = 0;
  for (Eigen::Index i = 0; i < x.size(); i += Dim) {
    const Vec<Dim> force = -now.template segment<Dim>(i);
    if (force.isZero(0) || !before.template segment<Dim>(i).isZero(0)) continue;
    const Vec<Dim> normal = force.normalized(), change = (v - v0).template segment<Dim>(i);
    const double speed = std::max(0.0, normal.dot(change));
    for (int c = 0; c < Dim; ++c)
      if (dofs_.unknown[i + c] != kNone) stopped[i + c] = speed * normal[c];
    if (!stopped.template segment<Dim>(i).isZero(0)) fastest = std::max(fastest, speed);
  }
  if (fastest == 0) return;
  errors.impact = 0.5 * stopped.dot(momentum(stopped));
  errors.resolving_dt = setup_.contact.dhat / (2 * fastest);
  VectorX flight = TimeIntegrator(setup_.time).predicted_increment(history);
  for (Eigen::Index i = 0; i < flight.size(); ++i)
    if (dofs_.unknown[i] == kNone) flight[i] = held_.target[i] - x0[i];
  errors.way_to_contact = potential_.contact_of_cells()->max_step(x0, flight, workspace_);
}

template <int Dim>
TimeErrors StepProblem<Dim>::time_errors(const History& history, const VectorX& x, bool has_system) {
  TimeErrors errors;
  const VectorX increment = increment_of(x), v = TimeIntegrator(setup_.time).velocity_after(increment, history);
  errors.energy = mechanical_energy(x, v);
  const auto& kinks = setup_.time.adaptive.kinks;
  const bool has_extrapolation = history.dt > 0 && !std::binary_search(kinks.begin(), kinks.end(), setup_.time.t0);
  if (dofs_.num_unknowns == 0 || !(terms_.has_inertia || has_extrapolation)) return errors;
  if (!has_system) {
    PrescribedMotion none;
    system().assemble(potential_.sum(lagged_), x, PsdProjection::clamp, dofs_, none, workspace_);
    system().factorize(0);
  }
  errors.local = local_error_energy(history, increment);
  if (terms_.has_inertia && potential_.contact()) find_impact(history, x, v, errors);
  return errors;
}

#define ITR_INSTANTIATE(Dim)                                                                                \
  template double StepProblem<Dim>::local_error_energy(const History&, const VectorX&);                     \
  template void StepProblem<Dim>::find_impact(const History&, const VectorX&, const VectorX&, TimeErrors&); \
  template TimeErrors StepProblem<Dim>::time_errors(const History&, const VectorX&, bool);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
