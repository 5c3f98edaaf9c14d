// SPDX-License-Identifier: MIT
// All that can touch in one stored configuration: facets of the bodies with the nodes of their edges, which edits and
// relaxations change, and obstacles, which stand still while a mesh is changed. Found by place.
#pragma once

#include <boost/container/static_vector.hpp>

#include <algorithm>
#include <array>
#include <compare>
#include <span>
#include <vector>

#include "geometry/bvh.hpp"
#include "geometry/distance.hpp"
#include "geometry/dynamic_tree.hpp"
#include "itr/mesh.hpp"
#include "remesh/fields.hpp"

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

/// Obstacles without what is part of something larger: triangles, edges of no triangle, points of no edge.
struct ObstaclePrimitives {
  struct Primitive {
    std::array<int, 3> vertices{kNone, kNone, kNone};
    int size = 0;
    std::span<const int> ids() const { return {vertices.data(), static_cast<std::size_t>(size)}; }
  };
  std::vector<Primitive> all;
  std::vector<std::vector<int>> at_vertex;  ///< indices into `all`

  template <int Dim>
  static ObstaclePrimitives make(const typename StepContext<Dim>::ObstacleGeometry& obstacles);
};

template <int Dim>
class SurfaceIndex {
 public:
  struct Hits {
    std::vector<FacetId> facets;  ///< ascending
    std::vector<int> obstacles;   ///< indices of primitives, ascending
  };

  /// At these positions of the mesh's vertices and the obstacles'; all of it must outlive this. `span` [m]: see stamp().
  SurfaceIndex(const Mesh<Dim>& mesh, const VectorX& x, const ObstaclePrimitives& primitives,
               const std::vector<Vec<Dim>>& obstacle_x, double span = 0);

  /// Whatever has a bounding box that meets `box`. Several may ask at once.
  void query(const Box<Dim>& box, Hits& hits) const;
  /// Takes in that the mesh changed: facets from `first_new` on are new, `removed` are gone.
  void follow(std::span<const FacetId> removed, FacetId first_new);
  /// Takes in that a vertex or a node has moved.
  void move(VertexId v);

  const Mesh<Dim>& mesh() const { return *mesh_; }
  Vec<Dim> at(VertexId v) const { return x_->template segment<Dim>(Dim * v); }
  const Vec<Dim>& obstacle_at(int v) const { return (*obstacle_x_)[v]; }
  const ObstaclePrimitives& primitives() const { return *primitives_; }
  /// Changes (and is never 0) whenever something changes nearer than span() to the facet.
  unsigned stamp(FacetId f) const { return stamps_[f]; }
  /// The stamp of the last change of the facet itself; later than all others where it is gone.
  unsigned changed(FacetId f) const { return changed_[f]; }
  double span() const { return span_; }
  /// The facet as a simplex of its vertices alone, and its pieces along its nodes.
  SurfacePiece<Dim> piece(FacetId f) const;
  SurfacePieces<Dim> pieces(FacetId f) const;
  /// Holds the pieces of a facet.
  Box<Dim> box_of(FacetId f) const;
  SurfacePiece<Dim> obstacle_piece(int primitive) const;

 private:
  void stamp_near(const Box<Dim>& box);

  const Mesh<Dim>* mesh_;
  const VectorX* x_;
  const ObstaclePrimitives* primitives_;
  const std::vector<Vec<Dim>>* obstacle_x_;
  double span_;
  std::vector<unsigned> stamps_, changed_;  ///< by facet
  unsigned now_ = 1;
  std::vector<FacetId> stamped_;
  DynamicTree<Dim> facets_;
  Bvh<Dim> obstacles_;
};

extern template class SurfaceIndex<2>;
extern template class SurfaceIndex<3>;

}  // namespace itr
