// SPDX-License-Identifier: MIT
// Planar bounds of motions: each vertex stops before a plane between it and each partner that it moves towards, so that
// what stops one vertex stops no other.
#pragma once

#include <array>

#include "pairs.hpp"

namespace itr {

/// Which shares of their ways the vertices of a pair may go, from 0 to 1, for a plane to stay between its primitives all the
/// way. `dhat`: they may come as near as half of it, or of their distance.
template <int Dim>
std::array<double, 4> planar_shares(PairKind kind, const Positions<Dim>& p, const Positions<Dim>& way, double dhat);

}  // namespace itr
