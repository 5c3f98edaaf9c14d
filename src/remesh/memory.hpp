// SPDX-License-Identifier: MIT
// Refusals of this step or an earlier one: most trials would only repeat them.
#pragma once

#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "remesh/candidate.hpp"

namespace itr {

/// Refusals, each with what it depended on. Part of a simulation's state: which candidates are asked again depends on it.
struct RemeshMemory {
  /// A refusal key is a number that stands for what a verdict depended on: as long as it stays in the range, so does the
  /// verdict. It is infinite where nobody can tell (pressure, damping, forces of programs); then no verdict stays.
  struct KeyRange {
    double least, most;
    bool in_contact;
    bool holds(double key, bool contact) const {
      return contact == in_contact && std::isfinite(key) && key >= least && key <= most;
    }
  };
  struct Entry {
    Candidate candidate;
    KeyRange range;
  };
  std::vector<Entry> refusals;  ///< ascending by candidate
  /// By kind, the strictest that a refusal was given under [J]; none before the first.
  std::array<std::optional<double>, kOperationKinds> tolerances{};

  /// To be called before operations with these tolerances. Refusals of a kind are forgotten where its tolerance accepts
  /// clearly more than the one that they were given under.
  void begin(const std::array<double, kOperationKinds>& present);

  /// With the vertex numbers of a compacted mesh; `number` has kNone for vertices that are gone.
  void renumber(std::span<const VertexId> number);
};

}  // namespace itr
