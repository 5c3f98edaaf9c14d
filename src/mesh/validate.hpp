// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <span>
#include <vector>

#include "geometry/closed_faces.hpp"
#include "itr/mesh.hpp"

namespace itr {

/// The first `most` pairs of edges (indices) that share a point in the plane without sharing a vertex, decided exactly;
/// pairs of which neither has a vertex with `counts`, and those that `closed` excuses, are skipped. Positions interleaved.
std::vector<std::array<int, 2>> find_intersections(ConstVectorView positions, std::span<const std::array<int, 2>> edges,
                                                   std::span<const char> counts, std::size_t most,
                                                   const ClosedFaces& closed = {});
/// Finds pairs of an edge and a triangle that intersect in space (indices).
std::vector<std::array<int, 2>> find_intersections(ConstVectorView positions, std::span<const std::array<int, 2>> edges,
                                                   std::span<const std::array<int, 3>> triangles,
                                                   std::span<const char> counts, std::size_t most,
                                                   const ClosedFaces& closed = {});

/// Whether the straight cell on these vertices is positively oriented, decided exactly.
template <int Dim>
bool is_positively_oriented(const typename MeshTypes<Dim>::Cell& cell, ConstVectorView positions);

}  // namespace itr
