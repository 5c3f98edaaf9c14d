// SPDX-License-Identifier: MIT
// Ladder of attempts of a step that fails. Its rungs, from the first attempt down:
//
// 1. The setup's integrator takes the step from the state as it is, remeshed with new curved edges if the scene allows them.
// 2. If the remeshed step fails, the first solve stays. The step is remeshed again without new curved edges, if it had some,
//    then not at all.
// 3. If Newmark's method would create energy, implicit Euler takes the step, remeshed as in 1.
// 4. If cells with curved edges may have stopped the first solve, edges are made straight in the state before the step, and
//    the step begins again at 1: around these cells, then everywhere, then everywhere at any volume of the new cells.
// 5. If the scene allows cuts, two steps of half the length go down their own ladder, by implicit Euler.
//
// An adaptive step is taken again from the top, and shorter, where its errors in time are too large, in place of 5, and
// before 3.
//
// A cancelled step has no next attempt. Rounds of lagging and retries of Newton's method are inside of one solve, and larger
// flat obstacles (flat_obstacles.hpp) are around the whole ladder.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "itr/types.hpp"
#include "time/step_control.hpp"

namespace itr {

enum class StepMethod { of_setup, implicit_euler };
enum class Remeshing { with_new_curves, without_new_curves, none };
/// Where curved edges are made straight before the step.
enum class Straightening { none, around_failure, everywhere, at_any_volume };

/// How a step, or a part of it, is taken. Its length is that of the step by 2^halvings, times that of the trial.
struct Attempt {
  int halvings = 0;
  StepMethod method = StepMethod::of_setup;
  Straightening straightening = Straightening::none;
  Remeshing remeshing = Remeshing::with_new_curves;
  StepTrial trial{};  ///< of an adaptive step
  bool operator==(const Attempt&) const = default;
};

/// Why an attempt led to no step.
struct StepFailure {
  enum class Kind {
    cancelled,             ///< by the program
    unsolved,              ///< the first solve found no solution
    creates_energy,        ///< more than TimeOptions::energy_growth_limit allows
    remeshed_unsolved,     ///< the second solve found none, or an invalid one
    nothing_straightened,  ///< no edge could become straight; all else is that of the failure before
    inaccurate             ///< in time: `trial` is the next
  };
  Kind kind = Kind::unsolved;
  std::string reason;
  std::vector<CellId> nearly_inverted;  ///< cells whose curved edges may have stopped the first solve
  bool has_new_curves = false;          ///< of the remeshed mesh that failed
  StepTrial trial{};                    ///< the next of a step whose errors in time are too large
};

/// Chooses the next attempt by what failed, without a mesh and without a solver.
struct StepLadder {
  int most_halvings = 0;  ///< TimeOptions::step_cuts
  double least_part = 1;  ///< that an adaptive step may be shortened to
  /// Returns nothing where the step has failed for good.
  std::optional<Attempt> next(const Attempt& attempt, const StepFailure& failure) const;
};

}  // namespace itr
