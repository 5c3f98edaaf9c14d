// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "geometry/closed_faces.hpp"
#include "itr/types.hpp"

namespace itr {

struct Retraction;

/// For each of n things a list of ids.
struct Adjacency {
  std::vector<int> offset = {0};  ///< n + 1
  std::vector<int> id;
  std::span<const int> operator[](int i) const { return std::span(id).subspan(offset[i], offset[i + 1] - offset[i]); }
};

/// The primitives that can touch: surfaces of all bodies, and obstacles. Vertices carry the ids of the problem they are part
/// of (the whole scene or a patch), and the per-vertex arrays have one entry for every vertex of that problem. What is said
/// of a vertex's or an edge's neighbours refers to the *whole* surface, also where only a part of it is here.
struct CollisionSurface {
  int revision = 0;  ///< another one whenever it is made anew in the same place
  /// Whether rest lengths are areas of the full turn about the axis x = 0 (2D); edges on it, at rest, are no surface then.
  bool axisymmetric = false;
  std::vector<int> vertices;                  ///< those on the surface, ascending
  std::vector<std::array<int, 2>> edges;      ///< surface edges, smaller id first, ascending
  std::vector<std::array<int, 3>> triangles;  ///< 3D only
  /// By problem vertex: half the rest lengths of the incident edges (2D), a third of the rest areas of the incident
  /// triangles (3D; half the edges where there is none); 1 where there are neither.
  std::vector<double> area;
  std::vector<int> degree;  ///< by problem vertex: incident edges
  /// By problem vertex: whether pairs with it count. False for obstacles, and around a patch for vertices whose contacts
  /// the patch cannot change.
  std::vector<char> counts;
  ClosedFaces closed;  ///< pairs that are no contact yet
  /// By problem vertex, which sides of ContactOptions::friction_pairs it is of: bits as FrictionSides has them. Empty: none.
  std::vector<std::uint64_t> friction_sides;
  VectorX rest;  ///< positions [m], where a direction of friction turns with a surface; else empty

  std::shared_ptr<const Retraction> retraction{};  ///< 2D: null where gaps are not averaged

  // 3D only.
  std::vector<std::array<int, 3>> triangle_edges;  ///< of corners (0 1), (1 2), (2 0)
  std::vector<double> edge_area;                   ///< a third of the incident triangles' rest areas, or the rest length
  std::vector<double> edge_length_squared;         ///< at rest [m^2]
  Adjacency vertex_edges;                          ///< edges at a vertex
  Adjacency edge_opposites;                        ///< by edge: the third vertices of its triangles
  std::vector<char> on_open_boundary;              ///< by problem vertex: has an edge with one triangle
};

/// The surface with these primitives (edges of the triangles are added) and codimensional `points`. `rest`: positions of all
/// vertices of the problem [m]; `counts` as in CollisionSurface.
template <int Dim>
CollisionSurface make_collision_surface(std::vector<std::array<int, 2>> edges, std::vector<std::array<int, 3>> triangles,
                                        std::span<const int> points, std::span<const Vec<Dim>> rest,
                                        std::vector<char> counts, bool axisymmetric = false);

/// Makes the rest of a surface of which edges, triangles and `counts` are set, in the memory that is there.
template <int Dim>
void complete_collision_surface(CollisionSurface& surface, std::span<const int> points, std::span<const Vec<Dim>> rest);

/// The first `most` pairs of two edges (2D), or of an edge and a triangle (3D), that share a point without sharing a vertex
/// and of which one counts: indices, decided exactly. Pairs that `closed` excuses are left out.
template <int Dim>
std::vector<std::array<int, 2>> find_intersections(const CollisionSurface& surface, ConstVectorView x, std::size_t most);
template <int Dim>
bool has_intersection(const CollisionSurface& surface, ConstVectorView x) {
  return !find_intersections<Dim>(surface, x, 1).empty();
}

}  // namespace itr
