// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <vector>

namespace itr {

/// How often the two chords of each curved edge are halved, by node of a curved edge of a compact mesh, from 0. Empty: no
/// chord is.
using ChordLevels = std::vector<std::uint8_t>;
template <int Dim>
inline constexpr int kMostHalvings = Dim == 2 ? 10 : 4;  ///< of a chord

}  // namespace itr
