// SPDX-License-Identifier: MIT
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "itr/mesh/mesh.hpp"

namespace itr {

/// The first two edges (indices) that share a point in the plane without sharing a vertex, decided exactly; pairs of which
/// neither has a vertex with `counts` are skipped. Positions interleaved.
std::optional<std::array<int, 2>> find_intersection(ConstVectorView positions, std::span<const std::array<int, 2>> edges,
                                                    std::span<const char> counts);
/// The same in space: the first edge and triangle (indices).
std::optional<std::array<int, 2>> find_intersection(ConstVectorView positions, std::span<const std::array<int, 2>> edges,
                                                    std::span<const std::array<int, 3>> triangles,
                                                    std::span<const char> counts);

/// The first cell (index among alive ids) that is not positively oriented at these positions, decided exactly; kNone: none.
template <int Dim>
CellId find_inverted(const Mesh<Dim>& mesh, ConstVectorView positions);

}  // namespace itr
