// SPDX-License-Identifier: MIT
// Errors of positions, velocities and accelerations that steps leave to the next (docs/theory.md, "Error bars").
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

#include "time/integrator.hpp"

namespace itr {

/// Errors at the state after the step to `positions` on the mesh of this revision: what is added to its history.
struct CarriedErrors {
  std::uint64_t revision = 0;
  VectorX positions{};
  History errors{};

  /// Whether the next step starts where they are known.
  bool are_of(const History& state, std::uint64_t of_revision) const {
    return positions.size() > 0 && revision == of_revision && positions == state.x[0] && errors.x.size() == state.x.size();
  }
  /// The history with them where they are of `state`, that from which the next step starts, else as it is. `history` may be
  /// that of another space.
  History added_to(History history, const History& state, std::uint64_t of_revision) const {
    if (!are_of(state, of_revision)) return history;
    const auto add = [](std::vector<VectorX>& to, const std::vector<VectorX>& what) {
      for (std::size_t i = 0; i < to.size(); ++i) to[i] += what[i];
    };
    add(history.x, errors.x);
    add(history.v, errors.v);
    add(history.a, errors.a);
    return history;
  }
};

inline History difference(const History& a, const History& b) {
  History result = a;
  const auto subtract = [](std::vector<VectorX>& from, const std::vector<VectorX>& what) {
    for (std::size_t i = 0; i < from.size(); ++i) from[i] -= what[i];
  };
  subtract(result.x, b.x);
  subtract(result.v, b.v);
  subtract(result.a, b.a);
  return result;
}

}  // namespace itr
