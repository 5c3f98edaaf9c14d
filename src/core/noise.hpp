// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>

namespace itr {

/// Fixed numbers in [-1, 1] without a pattern, one for each i (splitmix64).
inline double noise(std::uint64_t i) {
  std::uint64_t bits = (i + 1) * 0x9e3779b97f4a7c15;
  bits = (bits ^ (bits >> 30)) * 0xbf58476d1ce4e5b9;
  bits = (bits ^ (bits >> 27)) * 0x94d049bb133111eb;
  return static_cast<double>(static_cast<std::int64_t>(bits ^ (bits >> 31))) * 0x1p-63;
}

}  // namespace itr
