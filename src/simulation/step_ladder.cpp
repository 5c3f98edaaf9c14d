// SPDX-License-Identifier: MIT
#include "simulation/step_ladder.hpp"

namespace itr {

namespace {

constexpr double kShortest = 0.1;  ///< part of its first length from which implicit Euler takes what would create energy
constexpr double kShorter = 0.25;  ///< part that is tried next where an adaptive step has no solution

/// The top of the ladder of a step of this length.
Attempt first_attempt(int halvings) {
  return {.halvings = halvings, .method = halvings > 0 ? StepMethod::implicit_euler : StepMethod::of_setup};
}

}  // namespace

std::optional<Attempt> StepLadder::next(const Attempt& attempt, const StepFailure& failure) const {
  Attempt next = attempt;
  const auto shortened = [&](const StepTrial& trial) {
    next = first_attempt(0);
    next.trial = trial;
    return next;
  };
  switch (failure.kind) {
    case StepFailure::Kind::cancelled:
      return std::nullopt;
    case StepFailure::Kind::remeshed_unsolved:
      next.remeshing = failure.has_new_curves ? Remeshing::without_new_curves : Remeshing::none;
      return next;
    case StepFailure::Kind::inaccurate:
      return shortened(failure.trial);
    case StepFailure::Kind::creates_energy:
      if (least_part <= kShorter && attempt.trial.length > kShortest) break;
      if (attempt.method == StepMethod::implicit_euler) break;
      next.method = StepMethod::implicit_euler;
      next.remeshing = Remeshing::with_new_curves;
      return next;
    case StepFailure::Kind::unsolved:
    case StepFailure::Kind::nothing_straightened:
      if (failure.nearly_inverted.empty() || attempt.straightening == Straightening::at_any_volume) break;
      next = first_attempt(attempt.halvings);
      next.trial = attempt.trial;
      next.straightening = static_cast<Straightening>(static_cast<int>(attempt.straightening) + 1);
      return next;
  }
  if (least_part <= kShorter) return shortened(attempt.trial.shortened(kShorter));
  if (attempt.halvings == most_halvings) return std::nullopt;
  return first_attempt(attempt.halvings + 1);
}

}  // namespace itr
