// SPDX-License-Identifier: MIT
#pragma once

#include <functional>
#include <span>

#include "energy/constraint.hpp"
#include "newton/newton.hpp"

namespace itr {

/// Solves again with new multipliers until constraints are met, beside what solves leave of them. `d`: the increment from
/// `base` on, which `solve` goes on from and changes; `summary`: of the solve before, and at the end of all.
void close_constraints(std::span<Constraint* const> constraints, const VectorX& base, const VectorX& d,
                       const std::function<NewtonSummary()>& solve, const Units& units, NewtonSummary& summary);

}  // namespace itr
