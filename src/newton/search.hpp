// SPDX-License-Identifier: MIT
#pragma once

#include "dirichlet_continuation.hpp"

namespace itr {

class Arcs;

/// How far to go along a step: as far as the energy falls and the way is free. A step that contact or inversion blocks is
/// turned first, or each vertex goes as far as it can alone.
class Search {
 public:
  Search(const Task& task, Iterate& at, DirichletContinuation& held);

  /// Moves along the step; false where no fraction of it lowers the energy enough. The step may be turned.
  bool along(Step& step);
  /// Goes on along a way that lowered the energy, in steps of twice the length as long as they lower it. Near a saddle the
  /// projected Hessian is much stiffer than the true one, and Newton would need hundreds of equal steps.
  void go_on(ConstVectorView ahead);

 private:
  struct Scratch {
    ScratchVector candidate, other, steps;
  };
  /// Knowledge of a step before the search.
  struct Ahead {
    double fraction;        ///< that is free
    double slope;           ///< of the energy
    bool has_vertex_steps;  ///< those of each vertex alone are known
    bool is_turned = false;
  };
  bool along_arcs(const Arcs& arcs, Step& step);
  Ahead look_ahead(Step& step);
  bool is_acceptable(double value, double fraction, const Ahead& ahead, const Step& step);
  bool falls_straight(double value, double fraction, const Ahead& ahead, const Step& step);
  void try_vertex_steps(double& value);
  void note_blocked(const Step& step);
  double slope_at_candidate(const Step& step);

  const Task& task_;
  Iterate& at_;
  DirichletContinuation& held_;
  Scratch& scratch_;
  VectorView candidate_, other_;
  int last_blocked_ = -1;  ///< iteration
};

}  // namespace itr
