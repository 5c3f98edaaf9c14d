// SPDX-License-Identifier: MIT
// Solution of one step's problem, in rounds for the terms that are lagged: friction, damping, pressure without a potential.
#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "simulation/step_problem.hpp"

namespace itr {

/// Solves a problem and leaves in it the solution, its lagged terms and the barrier stiffness.
template <int Dim>
class LaggedSolve {
 public:
  LaggedSolve(StepProblem<Dim>& problem, bool must_settle) : problem_(problem), must_settle_(must_settle) {}
  /// Solves as StepProblem::solve says.
  NewtonSummary solve(VectorX& x, const VectorX& lagged_x, const VectorX& expected);

 private:
  using Lagged = typename IncrementalPotential<Dim>::Lagged;
  using Traits = TermTraits<Dim>;
  NewtonSummary minimize_first(VectorX& x, VectorX way_to_start);
  NewtonSummary minimize_lagged(VectorX& x, VectorX way_to_start = {},
                                const std::function<bool(const VectorX& x)>& ends_at = {});
  std::vector<double> contact_forces_on_loose_parts(const VectorX& x);
  NewtonSummary minimize_from(VectorX& x, const EnergySum& sum, NewtonExtras extras,
                              const std::function<bool(const VectorX& x)>& ends_at);
  void follow_least_motion(const EnergySum& sum, const VectorX& d);
  NewtonSummary explained(NewtonSummary summary, const EnergySum& sum, const VectorX& x);
  VectorX with_held_at_targets(VectorX x) const;
  bool is_better_start(const VectorX& start, const VectorX& x);
  VectorX start_of_solve(const VectorX& x);
  int most_rounds() const;
  bool has_lagged_loads() const;
  template <typename F>
  VectorX forces_of(const VectorX& x, const Lagged& lagged, const F& is_asked);
  template <typename F>
  double change_of(const VectorX& x, const Lagged& now, const F& is_asked);
  double largest_change(const VectorX& x, const Lagged& now);
  double asked_of_round(double change) const;
  double residual_with(const VectorX& x, const Lagged& lagged);
  VectorX residual_of_lagging(const VectorX& x, const Lagged& now);
  void follow_friction(const VectorX& x, NewtonExtras& extras);
  void judge_lagging(const VectorX& x, std::optional<Lagged> now, const char* how, int rounds, NewtonSummary& summary);

  StepProblem<Dim>& problem_;
  bool must_settle_;
  double loose_force_ = 0;  ///< of the forces that act: to which a round is solved that is not the last; 0: as the last
  const StepSetup<Dim>& setup_ = problem_.setup_;
  const PotentialTerms<Dim>& terms_ = problem_.terms_;
  const CellSet<Dim>& cells_ = problem_.cells_;
  const ContactSurface<Dim>& surface_ = problem_.surface_;
  Workspace& workspace_ = problem_.workspace_;
  const HeldDofs<Dim>& held_ = problem_.held_;
  const DofMap& dofs_ = problem_.dofs_;
  IncrementalPotential<Dim>& potential_ = problem_.potential_;
  const VectorX& base_ = problem_.base_;
  const std::shared_ptr<LeastMotion<Dim>>& least_motion_ = problem_.least_motion_;
  const std::unique_ptr<AdaptiveStiffness<Dim>>& adaptive_ = problem_.adaptive_;
  BarrierStiffness& stiffness_ = problem_.stiffness_;
  Lagged& lagged_ = problem_.lagged_;
  VectorX norm_weights_;  ///< of NewtonNorm, once needed
};

}  // namespace itr
