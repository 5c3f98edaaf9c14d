// SPDX-License-Identifier: MIT
// Errors that the length of steps has left in a solution (docs/theory.md, "Error bars").
#pragma once

#include <functional>
#include <vector>

#include "simulation/carried_errors.hpp"
#include "simulation/error_change.hpp"
#include "simulation/state.hpp"
#include "simulation/step_problem.hpp"

namespace itr {

/// Follows errors in time through the steps of a run. After a large impact, a change of the mesh, a step that was cut and in
/// a run that was resumed they are not known any more.
template <int Dim>
class TimeBars {
 public:
  /// Maps M e to (M + alpha h^2 K)^-1 M e; empty where that fails.
  using Filter = std::function<VectorX(const VectorX& momentum)>;
  /// Finds by how much the step to x and those before put its equations off: `change` is zero where nothing is known, and
  /// where solutions do not depend on steps. Local errors are filtered by the step's own matrix: motion that is faster than
  /// a step has none that could be told.
  void find(const StepSetup<Dim>& setup, const State<Dim>& state, StepProblem<Dim>& problem, const VectorX& x,
            const Filter& filter, SourceChange& change);
  /// Judges `motion`, the errors of the positions, and keeps what the step leaves to the next.
  void keep(const StepSetup<Dim>& setup, const State<Dim>& state, const StepProblem<Dim>& problem, const VectorX& x,
            const VectorX& motion);
  /// Knows nothing from now on.
  void lose() { are_lost_ = true; }

  /// Whether the last step's errors of displacements are known, and those of forces and the energy.
  bool knows_displacements() const { return !are_lost_ && knows_displacements_; }
  bool knows_forces() const { return !are_lost_ && knows_forces_; }

 private:
  bool filter_local_errors(const StepProblem<Dim>& problem, const VectorX& acted_on, double velocity_rate,
                           const Filter& filter);
  void judge(const StepSetup<Dim>& setup, const History& history, const StepProblem<Dim>& problem, const VectorX& motion);

  CarriedErrors carried_;
  std::vector<VectorX> accelerations_;  ///< at the last two states, newest first, of the mesh of `carried_`
  LocalError local_;                    ///< of the last step, filtered, where contact does not act
  VectorX of_predictor_;                ///< errors of the last x-hat
  double unresolved_ = 0;               ///< kinetic energy of what was filtered out so far [J]
  /// The largest errors so far that leading terms did not tell: kinetic energy by step [J], and elastic energy [J].
  double untold_displacement_ = 0, untold_force_ = 0;
  double energy_ = 0;   ///< mechanical, at the end of the last step [J]
  double elapsed_ = 0;  ///< since errors are followed [s]
  bool are_lost_ = false;
  bool knows_displacements_ = true, knows_forces_ = true;
};

}  // namespace itr
