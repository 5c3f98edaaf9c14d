// SPDX-License-Identifier: MIT
// Broad phase: pairs of primitives that can come within reach while every vertex stays in its box.
#pragma once

#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <utility>
#include <vector>

#include "core/scratch_vector.hpp"
#include "energy/contact/surface.hpp"
#include "geometry/bvh.hpp"
#include "geometry/distance.hpp"

namespace itr {

/// Boxes side by side, so that one is compared with several at once.
template <int Dim>
class BoxTable {
 public:
  void reset(const std::vector<Box<Dim>>& boxes) {
    overlaps_.assign((boxes.size() + kStride - 1) / kStride * kStride, 0);
    for (int c = 0; c < Dim; ++c) {
      min_[c].resize(boxes.size());
      max_[c].resize(boxes.size());
      for (std::size_t i = 0; i < boxes.size(); ++i) {
        min_[c][i] = boxes[i].min[c];
        max_[c][i] = boxes[i].max[c];
      }
    }
  }
  /// Calls visit(i) for all that overlap, ascending.
  template <typename Visit>
  void visit_overlaps(const Box<Dim>& box, const Visit& visit) {
    const std::size_t count = min_[0].size(), stored = overlaps_.size();  // named: what is a char may alias anything
    char* const overlaps = overlaps_.data();
    for (int c = 0; c < Dim; ++c) {
      const double *min = min_[c].data(), *max = max_[c].data(), low = box.min[c], high = box.max[c];
      for (std::size_t i = 0; i < count; ++i)
        overlaps[i] = static_cast<char>((c == 0 || overlaps[i]) & (min[i] <= high) & (max[i] >= low));
    }
    for (std::size_t first = 0; first < stored; first += kStride) {
      std::uint64_t any = 0;
      std::memcpy(&any, overlaps + first, kStride);
      if (any == 0) continue;
      for (std::size_t i = first; i < first + kStride; ++i)
        if (overlaps[i]) visit(static_cast<int>(i));
    }
  }

 private:
  static constexpr std::size_t kStride = sizeof(std::uint64_t);
  std::array<std::vector<double>, Dim> min_, max_;
  std::vector<char> overlaps_;  ///< 0 behind the last
};

/// Valid for many evaluations: the boxes hold a motion and some room around it. Kept in a Workspace.
template <int Dim>
class ContactCandidates {
 public:
  using Pairs = std::vector<std::array<int, 2>>;
  /// Makes the pairs hold for x. `reach`: pairs that come nearer than this count.
  void update(const CollisionSurface& surface, ConstVectorView x, double reach) {
    hold(surface, x, nullptr, reach, kNoLimit);
  }
  /// Makes the pairs hold for the motion of x by dx. Where these would be more than most_now(), `part` gets the longest of
  /// dx / 2, dx / 4, ... that takes no more, or that is shorter than `reach`. Returns the fraction of dx that the pairs hold
  /// for, at most `longest`.
  double update(const CollisionSurface& surface, ConstVectorView x, ConstVectorView dx, double reach, ScratchVector& part,
                double longest = 1);
  /// Finds the pairs of a motion anew with less room around it. Search trees of the surface are used again.
  void predict_motion(const CollisionSurface& surface, ConstVectorView x, ConstVectorView dx, double reach,
                      ScratchVector& part);
  /// Most pairs of each kind for a motion: far motions sweep boxes in which each primitive meets all others.
  static std::size_t most_pairs(const CollisionSurface& surface);

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
  static constexpr std::size_t kNoLimit = std::numeric_limits<std::size_t>::max();
  /// Makes the pairs hold for x and, where it is given, for the motion by dx. Returns false, and holds nothing, if more than
  /// `most` pairs of a kind do.
  bool hold(const CollisionSurface& surface, ConstVectorView x, const ConstVectorView* dx, double reach, std::size_t most);
  /// Searches for the pairs of a motion anew, with this fraction of the motion for room.
  bool search(const CollisionSurface& surface, ConstVectorView x, const ConstVectorView* dx, double reach, double fraction,
              std::size_t most);
  /// most_pairs(), or more where bodies at rest have more than a quarter of it.
  std::size_t most_now(const CollisionSurface& surface) const;
  double search_part(const CollisionSurface& surface, ConstVectorView x, ConstVectorView dx, double reach,
                     ScratchVector& part, double fraction);
  /// Room around a motion, so that the pairs serve a whole line search and often the next one [m].
  static double room_for(const CollisionSurface& surface, const ConstVectorView* dx, double reach, double fraction);
  double room_of(int v, const ConstVectorView* dx, double reach, double room) const;
  /// Finds the vertices that left their boxes, or whose boxes are much too roomy.
  void find_strays(const CollisionSurface& surface, ConstVectorView x, const ConstVectorView* dx, double reach, double room);
  void build_box(std::size_t i, int v, ConstVectorView x, const ConstVectorView* dx, double reach, double room);
  /// The pairs of a whole search with the present boxes, where all but those of the strays are as they were. Returns false
  /// if more than `most` pairs of a kind overlap.
  bool replace_pairs_of_strays(const CollisionSurface& surface, std::size_t most);

  bool holds_ = false;       ///< false where pairs were too many
  std::size_t at_rest_ = 0;  ///< the most pairs of a kind that a search without a limit has found since predict_motion()
  const CollisionSurface* surface_ = nullptr;
  int revision_ = 0;             ///< of the surface
  double searched_ = 0;          ///< reach of the last search [m]
  std::vector<Box<Dim>> boxes_;  ///< one a surface vertex: while it stays in there, the pairs hold
  std::vector<Box<Dim>> reach_;  ///< by problem vertex, half the reach around its box
  std::vector<double> rooms_;    ///< around the motions in `boxes_` [m]
  bool has_trees_ = false;       ///< of edges and triangles: a few vertices can be looked for again
  std::vector<int> strays_;      ///< indices of surface vertices whose boxes are made anew
  std::vector<char> is_stray_;   ///< by problem vertex
  Bvh<Dim> edge_tree_, triangle_tree_;
  Pairs vertex_edges_, vertex_triangles_, edge_edges_;
  std::vector<Box<Dim>> edge_boxes_, triangle_boxes_;
  BoxTable<Dim> table_;
};

}  // namespace itr
