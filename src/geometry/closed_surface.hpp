// SPDX-License-Identifier: MIT
// Points inside of closed surfaces, decided exactly: rays along the last axis, whose start is moved by an infinitesimal so
// that they meet no edge and no vertex.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "geometry/bvh.hpp"
#include "geometry/closed_faces.hpp"

namespace itr {

/// How deep a body is inside of a body.
template <int Dim>
struct Overlap {
  double depth = 0;  ///< 0: nowhere [m]
  Vec<Dim> place;
};

/// Polygons of oriented edges (2D) or polyhedra of oriented triangles (3D), cavities among them.
template <int Dim>
class ClosedSurface {
 public:
  using Facet = std::array<int, Dim>;
  /// `facets` over the points `x` [m]. Connected parts that are not closed (an end in 2D or an edge
  /// in 3D of an odd number of facets) are left out: they have no inside.
  ClosedSurface(std::vector<Vec<Dim>> x, std::span<const Facet> facets);

  /// Winding number around a point that is not on the surface, without the part `left_out`: 1 inside and 0 outside where
  /// facets are oriented outward and the surface does not cross itself; odd inside whatever the orientation.
  int winding(const Vec<Dim>& p, int left_out = kNone) const;
  /// Whether a closed facet has the point.
  bool touches(const Vec<Dim>& p) const;
  /// Whether a point is a vertex of the surface, and of which part; kNone: of none.
  bool is_vertex(int v) const { return part_[v] != kNone; }
  int part_of(int v) const { return part_[v]; }
  /// One vertex of each part whose inside is the inside of another part, too: of solids in solids, not of cavities. For
  /// facets with an orientation that do not cross each other. Parts are asked at a vertex that is not `doubtful`, if they
  /// have one; empty: none is.
  std::vector<int> nested(const std::vector<char>& doubtful = {}) const;
  /// The deepest overlap of bodies, at points of each facet: infinite where the facet has no closed vertex. Less than 1e3
  /// `closed.coincident` is none. For facets that are oriented outward; those with a vertex that is `left_out` do not count.
  Overlap<Dim> find_overlap(const ClosedFaces& closed, const std::vector<char>& left_out = {}) const;

 private:
  std::vector<Vec<Dim>> x_;
  std::vector<Facet> facets_;
  std::vector<int> part_;   ///< by point: a number of its part; kNone: not of the surface
  std::vector<int> first_;  ///< by part: a vertex; kNone: not closed
  Bvh<Dim> tree_;
};

}  // namespace itr
