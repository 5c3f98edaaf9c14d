// SPDX-License-Identifier: MIT
// Broad phase: pairs of primitives that can come within reach while every vertex stays in its box.
#pragma once

#include <array>
#include <utility>
#include <vector>

#include "itr/energy/contact/surface.hpp"
#include "itr/geometry/bvh.hpp"
#include "itr/geometry/distance.hpp"

namespace itr {

/// Valid for many evaluations: the boxes hold a motion and some room around it. Kept in a Workspace.
template <int Dim>
class ContactCandidates {
 public:
  using Pairs = std::vector<std::array<int, 2>>;
  /// Room around a motion, as a share of the longest: where steps of a solve lead, and where a solve is expected to go.
  static constexpr double kUnforeseen = 0.25, kForeseen = 0.02;

  /// Makes the pairs hold for x and, where it is given, for the motion by dx. `reach`: pairs that come nearer than this
  /// count.
  void update(const CollisionSurface& surface, ConstVectorView x, const VectorX* dx, double reach);
  /// That, whatever was found before, with this share of the motion for room. Search trees of the surface are used again.
  void search(const CollisionSurface& surface, ConstVectorView x, const VectorX* dx, double reach, double share);

  /// The lists that there are in this dimension, each with the kind of its pairs.
  std::array<std::pair<PairKind, const Pairs*>, Dim - 1> all() const {
    if constexpr (Dim == 2)
      return {{{PairKind::edge_vertex, &vertex_edges_}}};
    else
      return {{{PairKind::face_vertex, &vertex_triangles_}, {PairKind::edge_edge, &edge_edges_}}};
  }
  const Pairs& vertex_edges() const { return vertex_edges_; }          ///< (vertex, edge); 2D
  const Pairs& vertex_triangles() const { return vertex_triangles_; }  ///< (vertex, triangle); 3D
  const Pairs& edge_edges() const { return edge_edges_; }              ///< smaller index first where both count; 3D

 private:
  /// Room around a motion, so that the pairs serve a whole line search and often the next one [m].
  static double room_for(const CollisionSurface& surface, const VectorX* dx, double reach, double share);
  bool holds(const CollisionSurface& surface, ConstVectorView x, const VectorX* dx, double room) const;
  void build_boxes(const CollisionSurface& surface, ConstVectorView x, const VectorX* dx, double reach, double share);

  const CollisionSurface* surface_ = nullptr;
  double room_ = 0;              ///< around the motion of the last search [m]
  std::vector<Box<Dim>> boxes_;  ///< one a surface vertex: while it stays in there, the pairs hold
  std::vector<Box<Dim>> reach_;  ///< by problem vertex, half the reach around its box
  Bvh<Dim> edge_tree_, triangle_tree_;
  Pairs vertex_edges_, vertex_triangles_, edge_edges_;
};

}  // namespace itr
