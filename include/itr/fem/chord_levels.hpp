// SPDX-License-Identifier: MIT
#pragma once

#include <cstdint>
#include <vector>

namespace itr {

/// How often the two chords of each curved edge are halved, by curved edge of a space. Empty: no chord is.
using ChordLevels = std::vector<std::uint8_t>;
template <int Dim>
inline constexpr int kMostHalvings = Dim == 2 ? 7 : 4;  ///< of a chord

}  // namespace itr
