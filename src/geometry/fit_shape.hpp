// SPDX-License-Identifier: MIT
// The numbers of a shape from a mesh whose vertices lie on it.
#pragma once

#include <optional>
#include <span>

#include "geometry/shape.hpp"

namespace itr {

using SurfaceTriangle = std::array<Vec<3>, 3>;

/// A shape through the corners of triangles, and how far one of these is off it, at most [m].
struct ShapeFit {
  Shape shape;
  double farthest;
};

/// The shape of this kind that is nearest to the corners, in the mean of squares: Levenberg and Marquardt's method on the
/// distances, begun from the normals of the triangles (Pottmann and Randrup 1998, "Rotational and helical surface
/// approximation": the normals of a surface of revolution meet its axis). Nothing if no start leads
/// to a shape, or the corners are too few to tell one.
std::optional<ShapeFit> fit_shape(Shape::Kind kind, std::span<const SurfaceTriangle> triangles);

/// The kind of shape that the corners lie on up to `tolerance` of their box's diagonal. Corners alone may not tell it (two
/// rings of them lie on a sphere and a cylinder): the normals of the triangles do, and of kinds that are as near the first
/// one of Shape::Kind is taken. Nothing if they lie on none.
std::optional<ShapeFit> recognize_shape(std::span<const SurfaceTriangle> triangles, double tolerance);

}  // namespace itr
