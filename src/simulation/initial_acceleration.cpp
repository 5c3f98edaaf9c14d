// SPDX-License-Identifier: MIT
#include "initial_acceleration.hpp"

#include <memory>

#include "itr/core.hpp"

namespace itr {

template <int Dim>
void set_consistent_acceleration(const Setup<Dim>& setup, State<Dim>& state, ProblemCache<Dim>& cache) {
  SparseSystem& system = cache.system;
  StepProblem<Dim> problem(setup, state.mesh, state.history, state.t, cache, state.stiffness, {}, state.chords);
  VectorX force = problem.total_force(state.history.x[0], state.history.v[0]);
  const DofMap& dofs = problem.dofs();
  VectorX& a = state.history.a[0];
  const VectorX zero = VectorX::Zero(a.size());
  EnergySum sum;
  const auto inertia = std::make_shared<InertiaEnergy<Dim>>(problem.cells(), setup.materials,
                                                            setup.lump_mass ? MassKind::lumped : MassKind::consistent, zero);
  sum.add(inertia);
  VectorX held = a;
  for (Eigen::Index i = 0; i < a.size(); ++i)
    if (dofs.unknown[i] != kNone) held[i] = 0;
  VectorX of_held = zero;
  inertia->add_mass_product(held, of_held);
  Workspace workspace;
  PrescribedMotion motion;
  VectorX rhs(dofs.num_unknowns), solution(dofs.num_unknowns);
  for (Eigen::Index i = 0; i < a.size(); ++i)
    if (dofs.unknown[i] != kNone) rhs[dofs.unknown[i]] = force[i] - of_held[i];
  if (dofs.num_unknowns == 0) return;
  system.assemble(sum, zero, PsdProjection::none, dofs, motion, workspace);
  linear::Outcome outcome = rhs.allFinite() ? system.factorize(0).outcome : linear::Outcome::non_finite;
  if (outcome == linear::Outcome::ok) outcome = system.solve_again(rhs, solution).outcome;
  if (outcome != linear::Outcome::ok)
    throw InputError({"", "/initial_conditions/acceleration",
                      "\"consistent\", but M a = f cannot be solved at the start: " + std::string(to_string(outcome)) +
                          ", " + (rhs.allFinite() ? system.message() : "a force is not finite"),
                      "masses above 0 and a solver that copes with the mass matrix, or a given acceleration"});
  for (Eigen::Index i = 0; i < a.size(); ++i)
    if (dofs.unknown[i] != kNone) a[i] = solution[dofs.unknown[i]];
}

template void set_consistent_acceleration<2>(const Setup<2>&, State<2>&, ProblemCache<2>&);
template void set_consistent_acceleration<3>(const Setup<3>&, State<3>&, ProblemCache<3>&);

}  // namespace itr
