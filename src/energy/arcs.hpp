// SPDX-License-Identifier: MIT
#pragma once

#include "itr/types.hpp"

namespace itr {

/// An energy of which some unknowns turn: steps of them are better taken along arcs than along tangents.
class Arcs {
 public:
  virtual ~Arcs() = default;
  /// Makes a step from x the chord to where it leads along arcs; returns the largest turn [rad].
  virtual double bend(ConstVectorView x, VectorView step) const = 0;
};

}  // namespace itr
