// SPDX-License-Identifier: MIT
// Refusals of this step or an earlier one: most trials would only repeat them.
#pragma once

#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <vector>

#include "itr/remesh/place.hpp"

namespace itr {

/// Refusals, each with what it depended on. Part of a simulation's state: which edges are asked again depends on it.
struct RemeshMemory {
  /// A signal is a number that stands for what a verdict depended on: as long as it stays in the range, so does the verdict.
  /// It is infinite where nobody can tell (pressure, damping, forces of programs); then no verdict stays.
  struct SignalRange {
    double least, most;
    bool in_contact;
    bool holds(double signal, bool contact) const {
      return contact == in_contact && std::isfinite(signal) && signal >= least && signal <= most;
    }
  };
  struct Entry {
    Place place;
    SignalRange range;
  };
  enum Kind { split, collapse, swap, smooth, reshape, curve, straighten };
  static constexpr int kKinds = 7;
  using Refusals = std::array<std::vector<Entry>, kKinds>;
  Refusals refusals;  ///< by Kind; ascending by place
  /// By Kind, the strictest that a refusal was given under [J]; none before the first.
  std::array<std::optional<double>, kKinds> tolerances{};

  /// To be called before operations with these tolerances. Refusals of a kind are forgotten where its tolerance accepts
  /// clearly more than the one that they were given under.
  void begin(const std::array<double, kKinds>& present);

  /// With the vertex numbers of a compacted mesh; `number` has kNone for vertices that are gone.
  void renumber(std::span<const VertexId> number);
};

}  // namespace itr
