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
  void find_unbalanced_reactions(const Setup<Dim>& setup, const StepReport& report, const NodalForces& forces,
                                 const Logger& logger);

  bool has_said_rotation_ = false, has_said_remeshing_ = false, has_said_forces_ = false, has_said_reactions_ = false;
  int loose_steps_ = 0, unbalanced_steps_ = 0;  ///< in a row
  double largest_reaction_ = 0;                 ///< at a vertex, so far [N]
};

}  // namespace itr
