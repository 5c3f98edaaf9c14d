// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "itr/mesh.hpp"

namespace itr {

/// Unit normal of a facet with these corners; 0 where it has no area.
inline Vec<2> unit_normal(const std::array<Vec<2>, 2>& p) {
  return Vec<2>(p[1][1] - p[0][1], p[0][0] - p[1][0]).stableNormalized();
}
inline Vec<3> unit_normal(const std::array<Vec<3>, 3>& p) { return (p[1] - p[0]).cross(p[2] - p[0]).stableNormalized(); }

/// How far the curve over a node between the corners i and j of a facet leaves its two chords, across the surface there [m].
/// Contact acts on the chords.
template <int Dim>
double distance_from_chords(const std::array<Vec<Dim>, Dim>& facet, int i, int j, const Vec<Dim>& node) {
  const Vec<Dim> bulge = node - (facet[i] + facet[j]) / 2;
  double largest = 0;
  for (const int k : {i, j}) {
    auto half = facet;
    half[k] = node;
    largest = std::max(largest, std::abs(bulge.dot(unit_normal(half))));
  }
  return largest / 4;
}

/// Calls add(ids) for the simplices through all nodes of a boundary facet, oriented as the facet: of a triangle with 1, 2, 3
/// curved edges 2, 3, 4; with 2 the diagonal starts at the vertex of lower id.
/// `node_of(a, b)`: the node of an edge, or kNone where it is straight.
template <int Dim, typename NodeOf, typename Add>
void for_each_chord(const typename MeshTypes<Dim>::Facet& facet, const NodeOf& node_of, const Add& add) {
  using Facet = typename MeshTypes<Dim>::Facet;
  if constexpr (Dim == 2) {
    const int middle = node_of(facet[0], facet[1]);
    if (middle == kNone) return add(facet);
    add(Facet{facet[0], middle});
    add(Facet{middle, facet[1]});
  } else {
    std::array<int, 3> middle;  // of the edge from corner k to corner k + 1
    int count = 0;
    for (int k = 0; k < 3; ++k) {
      middle[k] = node_of(facet[k], facet[(k + 1) % 3]);
      count += middle[k] != kNone;
    }
    if (count == 0) return add(facet);
    // Turned so that with one curved edge it is the first, and with two the straight one is the last.
    int turn = 0;
    while (count == 1 ? middle[turn] == kNone : count == 2 && middle[(turn + 2) % 3] != kNone) ++turn;
    const auto corner = [&](int k) { return facet[(turn + k) % 3]; };
    const int m01 = middle[turn], m12 = middle[(turn + 1) % 3], m20 = middle[(turn + 2) % 3];
    if (count == 1) {
      add(Facet{corner(0), m01, corner(2)});
      add(Facet{m01, corner(1), corner(2)});
      return;
    }
    add(Facet{m01, corner(1), m12});
    if (count == 2) {  // and the quadrilateral 0, m01, m12, 2
      if (corner(0) < corner(2)) {
        add(Facet{corner(0), m01, m12});
        add(Facet{corner(0), m12, corner(2)});
      } else {
        add(Facet{corner(0), m01, corner(2)});
        add(Facet{m01, m12, corner(2)});
      }
      return;
    }
    add(Facet{corner(0), m01, m20});
    add(Facet{m20, m12, corner(2)});
    add(Facet{m01, m12, m20});
  }
}

}  // namespace itr
