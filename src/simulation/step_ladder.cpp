// SPDX-License-Identifier: MIT
#include "simulation/step_ladder.hpp"

namespace itr {

namespace {

/// The top of the ladder of a step of this length.
Attempt first_attempt(int halvings) {
  return {.halvings = halvings, .method = halvings > 0 ? StepMethod::implicit_euler : StepMethod::of_setup};
}

}  // namespace

std::optional<Attempt> StepLadder::next(const Attempt& attempt, const StepFailure& failure) const {
  Attempt next = attempt;
  switch (failure.kind) {
    case StepFailure::Kind::cancelled:
      return std::nullopt;
    case StepFailure::Kind::remeshed_unsolved:
      next.remeshing = failure.has_new_curves ? Remeshing::without_new_curves : Remeshing::none;
      return next;
    case StepFailure::Kind::creates_energy:
      if (attempt.method == StepMethod::implicit_euler) break;
      next.method = StepMethod::implicit_euler;
      next.remeshing = Remeshing::with_new_curves;
      return next;
    case StepFailure::Kind::unsolved:
    case StepFailure::Kind::nothing_straightened:
      if (failure.nearly_inverted.empty() || attempt.straightening == Straightening::at_any_volume) break;
      next = first_attempt(attempt.halvings);
      next.straightening = static_cast<Straightening>(static_cast<int>(attempt.straightening) + 1);
      return next;
  }
  if (attempt.halvings == most_halvings) return std::nullopt;
  return first_attempt(attempt.halvings + 1);
}

}  // namespace itr
