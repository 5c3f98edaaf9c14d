// SPDX-License-Identifier: MIT
// Warnings about the end of a step against the model or its tolerances. Each is said once.
#pragma once

#include "simulation/state.hpp"

namespace itr {

template <int Dim>
class Watch {
 public:
  void look(const Setup<Dim>& setup, const State<Dim>& state, const StepReport& report, const NodalForces& forces,
            const Logger& logger);

 private:
  void find_rotation(const Setup<Dim>& setup, const State<Dim>& state, const Logger& logger);
  void find_starved_remeshing(const Setup<Dim>& setup, const StepReport& report, const Logger& logger);
  void find_loose_forces(const Setup<Dim>& setup, const State<Dim>& state, const StepReport& report, const Logger& logger);
  void find_wide_gaps(const Setup<Dim>& setup, const State<Dim>& state, const StepReport& report, const Logger& logger);
  void find_unbalanced_reactions(const Setup<Dim>& setup, const StepReport& report, const NodalForces& forces,
                                 const Logger& logger);
  void find_long_chords(const Setup<Dim>& setup, const State<Dim>& state, const Logger& logger);

  bool has_said_rotation_ = false, has_said_remeshing_ = false, has_said_forces_ = false, has_said_reactions_ = false;
  int loose_steps_ = 0, unbalanced_steps_ = 0;  ///< in a row
  double largest_reaction_ = 0;                 ///< at a vertex, so far [N]
  double most_elastic_ = 0;                     ///< energy of a step so far [J]
  double gap_fraction_ = 0;                     ///< in that step: gaps by the rest of the way that bodies are compressed
  double gap_ = 0;                              ///< in that step, the mean by force [m]
};

}  // namespace itr
