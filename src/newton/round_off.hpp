// SPDX-License-Identifier: MIT
#pragma once

namespace itr {

/// NewtonSummary::message of a solve whose last steps promised less than energy or positions resolve.
inline constexpr const char* kAtRoundOff =
    "converged to the round-off of energy and positions, above the tolerances asked for";

}  // namespace itr
