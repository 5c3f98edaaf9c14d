// SPDX-License-Identifier: MIT
// A simplex of the surface or of an obstacle, by itself.
#pragma once

#include <algorithm>
#include <array>
#include <compare>

#include <boost/container/static_vector.hpp>
#include "geometry/bvh.hpp"
#include "geometry/distance.hpp"
#include "itr/mesh.hpp"

namespace itr {

/// The number of a vertex or facet of the mesh, or of a vertex or primitive of the obstacles: these come first in order.
class SurfaceId {
 public:
  constexpr SurfaceId() = default;
  constexpr SurfaceId(int of_mesh) : code_(of_mesh) {}
  static constexpr SurfaceId of_obstacle(int number) { return kNone - 1 - number; }
  constexpr bool is_of_obstacle() const { return code_ < kNone; }
  constexpr int number() const { return is_of_obstacle() ? kNone - 1 - code_ : code_; }
  auto operator<=>(const SurfaceId&) const = default;

 private:
  int code_ = kNone;
};

/// Positions [m] and ids, which say what corners two pieces share.
template <int Dim>
struct SurfacePiece {
  std::array<Vec<Dim>, 3> p;
  std::array<SurfaceId, 3> id{};
  int size = 0;
  Box<Dim> box;

  void add(const Vec<Dim>& point, SurfaceId number) {
    p[size] = point;
    id[size++] = number;
    box.include(point);
  }
  bool has(SurfaceId number) const { return std::find(id.begin(), id.begin() + size, number) != id.begin() + size; }
};

/// The simplices through all nodes of a facet: one where its edges are straight.
template <int Dim>
using SurfacePieces = boost::container::static_vector<SurfacePiece<Dim>, Dim == 2 ? 2 : 4>;

/// Least distance of a vertex and an edge (2D), a vertex and a triangle or two edges (3D) of two pieces, without a common
/// corner; `limit` where it is no less [m].
template <int Dim>
double distance_below(const SurfacePiece<Dim>& a, const SurfacePiece<Dim>& b, double limit);
/// Whether it is less than `reach` [m].
template <int Dim>
bool come_near(const SurfacePiece<Dim>& a, const SurfacePiece<Dim>& b, double reach);

}  // namespace itr
