// SPDX-License-Identifier: MIT
#pragma once

#include "itr/energy/energy.hpp"
#include "itr/fem/cell_set.hpp"

namespace itr {

/// The rotation of a connected set of held vertices from one step to the next.
struct HeldTurn {
  double degrees = 0;
  int vertex = kNone;  ///< one of them
};

/// The largest rotation, from positions `from` to `to`, of vertices that are held in every component and joined by edges of
/// cells. Sets that do not move as rigid bodies are left out.
template <int Dim>
HeldTurn find_largest_turn(const CellSet<Dim>& cells, const DofMap& dofs, ConstVectorView from, ConstVectorView to);

}  // namespace itr
