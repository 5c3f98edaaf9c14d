// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <limits>

#include "itr/types.hpp"

namespace itr {

inline constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

/// Changes each number in its last bits, up or down by a fixed pattern without symmetry (a multiplicative hash).
inline void change_last_bits(ConstVectorView from, VectorView to) {
  for (Eigen::Index i = 0; i < from.size(); ++i) {
    const bool is_up = (static_cast<std::uint64_t>(i + 1) * 0x9E3779B97F4A7C15u) >> 63;
    to[i] = from[i] * (is_up ? 1 + kEpsilon : 1 - kEpsilon);
  }
}

}  // namespace itr
