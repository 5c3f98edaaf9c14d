// SPDX-License-Identifier: MIT
// Candidates with their vertices and positions.
#pragma once

#include <array>

#include "energy/contact/surface.hpp"
#include "geometry/bvh.hpp"
#include "geometry/ccd.hpp"
#include "geometry/distance.hpp"

namespace itr {

template <int Dim>
using Positions = std::array<Vec<Dim>, 4>;

template <int Dim>
Positions<Dim> gather(const std::array<int, 4>& vertices, int size, ConstVectorView x) {
  Positions<Dim> p;
  for (int k = 0; k < size; ++k) p[k] = x.segment<Dim>(Dim * vertices[k]);
  return p;
}

/// Number of vertices of the pair's first primitive.
inline int size_of_first(PairKind kind) { return kind == PairKind::edge_edge ? 2 : 1; }

/// Vertices of a candidate: those of its first primitive, then those of the second.
inline std::array<int, 4> vertices_of(const CollisionSurface& surface, PairKind kind, const std::array<int, 2>& pair) {
  const auto [i, j] = pair;
  if (kind == PairKind::edge_vertex) return {i, surface.edges[j][0], surface.edges[j][1], kNone};
  if (kind == PairKind::face_vertex) return {i, surface.triangles[j][0], surface.triangles[j][1], surface.triangles[j][2]};
  return {surface.edges[i][0], surface.edges[i][1], surface.edges[j][0], surface.edges[j][1]};
}

/// Whether the boxes around the ways of both primitives from p to q overlap.
template <int Dim>
bool motions_overlap(PairKind kind, const Positions<Dim>& p, const Positions<Dim>& q) {
  Box<Dim> first, second;
  for (int k = 0; k < pair_size(kind); ++k) {
    Box<Dim>& box = k < size_of_first(kind) ? first : second;
    box.include(p[k]);
    box.include(q[k]);
  }
  return first.overlaps(second);
}

/// Fraction of the way from p to q that is free of contact, by conservative CCD.
template <int Dim>
double free_fraction(PairKind kind, const Positions<Dim>& p, const Positions<Dim>& q, const CcdOptions& options = {}) {
  if (!motions_overlap<Dim>(kind, p, q)) return 1;
  if constexpr (Dim == 2) return point_edge_ccd<2>(p[0], p[1], p[2], q[0], q[1], q[2], options);
  if constexpr (Dim == 3)
    return kind == PairKind::edge_edge ? edge_edge_ccd(p[0], p[1], p[2], p[3], q[0], q[1], q[2], q[3], options)
                                       : point_triangle_ccd(p[0], p[1], p[2], p[3], q[0], q[1], q[2], q[3], options);
}

}  // namespace itr
