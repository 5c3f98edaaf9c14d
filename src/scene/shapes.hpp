// SPDX-License-Identifier: MIT
// `/shapes` of a scene (docs/theory.md, "True shapes").
#pragma once

#include <span>
#include <vector>

#include "geometry/fit_shape.hpp"
#include "itr/setup.hpp"
#include "node.hpp"
#include "sets.hpp"

namespace itr::scene {

/// An entry of `/shapes` for surfaces of bodies or obstacles.
struct ShapeEntry {
  Node node;
  Shape shape;
  bool has_numbers;  ///< else they are those of the shape through the vertices of each surface
};

/// Reads the entries. `surfaces` are the ids that surfaces of bodies and obstacles have. Throws InputError for others, for
/// keys that a type lacks or does not have, and for surfaces in two entries.
template <int Dim>
std::vector<ShapeEntry> read_shapes(const Node& root, const Sets& sets, const std::set<int>& surfaces);

/// The shape of an entry, where there are no numbers that through the corners of these triangles; in 2D those of edges, see
/// `raised`. Throws InputError if there is none, and where a corner is far off the numbers that there are.
template <int Dim>
Shape shape_through(const ShapeEntry& entry, std::span<const SurfaceTriangle> triangles);

/// Two triangles over an edge of a planar scene: a line gets a plane through them, a circle a cylinder.
std::array<SurfaceTriangle, 2> raised(const Vec<2>& a, const Vec<2>& b);

/// Gives a setup the shapes of the surfaces of its mesh.
template <int Dim>
void add_shapes(const std::vector<ShapeEntry>& entries, Setup<Dim>& setup);

}  // namespace itr::scene
