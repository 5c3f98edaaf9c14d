// SPDX-License-Identifier: MIT
#pragma once

#include <string>

#include "energy/energy.hpp"
#include "fem/cell_set.hpp"

namespace itr {

/// In words, the largest rotation, from positions `from` to `to`, of vertices that are held in every component and joined by
/// edges of cells, if bodies may find no way through it; else nothing. Sets that do not move as rigid bodies are left out.
template <int Dim>
std::string describe_large_turn(const CellSet<Dim>& cells, const DofMap& dofs, ConstVectorView from, ConstVectorView to);

}  // namespace itr
