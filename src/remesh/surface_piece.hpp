// SPDX-License-Identifier: MIT
// A simplex of the surface or of an obstacle, by itself.
#pragma once

#include <algorithm>
#include <array>

#include "itr/geometry/bvh.hpp"
#include "itr/geometry/distance.hpp"
#include "itr/mesh/mesh.hpp"

namespace itr {

/// Positions [m] and ids, which say what corners two pieces share.
template <int Dim>
struct SurfacePiece {
  std::array<Vec<Dim>, 3> p;
  std::array<int, 3> id{kNone, kNone, kNone};
  int size = 0;
  Box<Dim> box;

  /// Of the obstacles' vertices, and back; those of the mesh keep theirs.
  static constexpr int id_of_obstacle(int v) { return kNone - 1 - v; }
  void add(const Vec<Dim>& point, int number) {
    p[size] = point;
    id[size++] = number;
    box.include(point);
  }
  bool has(int number) const { return std::find(id.begin(), id.begin() + size, number) != id.begin() + size; }
};

/// Least distance of a vertex and an edge (2D), a vertex and a triangle or two edges (3D) of two pieces, without a common
/// corner; `limit` where it is no less [m].
template <int Dim>
double distance_below(const SurfacePiece<Dim>& a, const SurfacePiece<Dim>& b, double limit);
/// Whether it is less than `reach` [m].
template <int Dim>
bool come_near(const SurfacePiece<Dim>& a, const SurfacePiece<Dim>& b, double reach);

}  // namespace itr
