// SPDX-License-Identifier: MIT
// Errors in time of a step that is solved (docs/theory.md, "Adaptive time").
#include <algorithm>
#include <cmath>
#include <utility>

#include "energy/incremental_potential.hpp"
#include "fem/unknowns.hpp"
#include "simulation/step_problem.hpp"

namespace itr {

/// Energy of an error e in time once the step has filtered it, (M + alpha h^2 K) f = M e: motion that is faster than a
/// step, such as that of a barrier, is damped anyway. Forces M e on nodes that contact acts on at either end jump with it,
/// and are left out: find_impact judges these jumps by their energy.
template <int Dim>
void StepProblem<Dim>::find_local_error(const History& history, const VectorX& increment, const VectorX& contact,
                                        TimeErrors& errors) {
  const TimeIntegrator integrator(setup_.time);
  const auto mass_product = [&](const VectorX& values) { return at_unknowns(dofs_, momentum(at_dofs(dofs_, values))); };
  if (!terms_.has_inertia) {
    const double h = setup_.time.dt, chord = 4 * (1 + history.dt / h);
    const VectorX d = at_unknowns(dofs_, (increment - h * history.v[0]) / chord);
    VectorX force(dofs_.num_unknowns);
    newton_system().product()(d, force);
    errors.local = 0.5 * std::max(0.0, d.dot(force)) / terms_.scaling;
    return;
  }
  const LocalError error = integrator.local_error(increment, history);
  const auto filtered = [&](const VectorX& e) {
    constexpr double kDigits = 1e-3;
    const VectorX values = at_unknowns(dofs_, e);
    VectorX force = mass_product(values), f(values.size());
    for (Eigen::Index i = 0; i < contact.size(); ++i)
      if (contact[i] != 0 && dofs_.unknown[i] != kNone) force[dofs_.unknown[i]] = 0;
    linear::Asked asked{.residual = kDigits};
    asked.if_indefinite = true;
    const bool is_solved = newton_system().solve(0, force, asked, f).outcome == linear::Outcome::ok && f.allFinite();
    return is_solved ? std::pair(force, f) : std::pair(force, values);
  };
  const auto [force, f] = filtered(error.x);
  errors.local = std::max(0.0, f.dot(force - mass_product(f)) / (2 * terms_.scaling));
  VectorX loads = VectorX::Zero(increment.size());
  EnergySum sum;
  potential_.add_to(sum, lagged_, [](const Traits& term) { return term.kind == TermKind::loads; });
  sum.add_gradient(base_ + increment, loads, workspace_);
  errors.work = std::abs(f.dot(at_unknowns(dofs_, loads))) / terms_.scaling;
  if (error.v.size() == 0) return;
  const VectorX f_v = filtered(error.v).second;
  errors.local += 0.5 * f_v.dot(mass_product(f_v));
}

template <int Dim>
VectorX StepProblem<Dim>::contact_gradient(const VectorX& x) {
  VectorX gradient = VectorX::Zero(x.size());
  potential_.contact_of_cells()->add_gradient(x, gradient, workspace_);
  return gradient;
}

/// Nodes that no contact force acted on before the step, and that one has stopped in its direction. Gradients of contact are
/// those before the step and at x.
template <int Dim>
void StepProblem<Dim>::find_impact(const History& history, const VectorX& x, const VectorX& v, const VectorX& before,
                                   const VectorX& now, TimeErrors& errors) {
  const VectorX &x0 = history.x[0], &v0 = history.v[0];
  VectorX stopped = VectorX::Zero(x.size());
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
VectorX StepProblem<Dim>::contact_in_step(const History& history, const VectorX& x, TimeErrors& errors) {
  if (!potential_.contact()) return {};
  const VectorX v = TimeIntegrator(setup_.time).velocity_after(increment_of(x), history);
  const VectorX now = contact_gradient(x), before = contact_gradient(history.x[0]);
  find_impact(history, x, v, before, now, errors);
  VectorX acted_on = now.cwiseAbs() + before.cwiseAbs();
  for (std::size_t age = 1; age < history.x.size(); ++age) acted_on += contact_gradient(history.x[age]).cwiseAbs();
  return acted_on;
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
    newton_system().assemble(potential_.sum(lagged_), x, PsdProjection::clamp, dofs_, none, workspace_);
  }
  const VectorX acted_on = terms_.has_inertia ? contact_in_step(history, x, errors) : VectorX();
  find_local_error(history, increment, acted_on, errors);
  return errors;
}

#define ITR_INSTANTIATE(Dim)                                                                                     \
  template void StepProblem<Dim>::find_local_error(const History&, const VectorX&, const VectorX&, TimeErrors&); \
  template void StepProblem<Dim>::find_impact(const History&, const VectorX&, const VectorX&, const VectorX&,    \
                                              const VectorX&, TimeErrors&);                                      \
  template VectorX StepProblem<Dim>::contact_in_step(const History&, const VectorX&, TimeErrors&);               \
  template TimeErrors StepProblem<Dim>::time_errors(const History&, const VectorX&, bool);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
