// SPDX-License-Identifier: MIT
#pragma once

#include <functional>

#include "energy/tie.hpp"
#include "itr/options.hpp"
#include "newton/newton.hpp"

namespace itr {

/// Solves again with new multipliers until ties have no gaps, beside what solves leave of them. `d`: the increment from
/// `base` on, which `solve` goes on from and changes; `summary`: of the solve before, and at the end of all.
template <int Dim>
void close_ties(TieEnergy<Dim>& tie, const CellSet<Dim>& cells, const VectorX& base, const VectorX& d,
                const std::function<NewtonSummary()>& solve, const Units& units, NewtonSummary& summary);

}  // namespace itr
