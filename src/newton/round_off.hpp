// SPDX-License-Identifier: MIT
#pragma once

namespace itr {

/// NewtonSummary::message of a solve after which no step lowers the forces that are left, which are their round-off.
inline constexpr const char* kAtRoundOff = "converged to the round-off of forces, above the tolerances asked for";

}  // namespace itr
