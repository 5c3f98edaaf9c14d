// SPDX-License-Identifier: MIT
// Exact predicates on the given doubles (CGAL's filtered exact kernel stays in the .cpp).
#pragma once

#include "itr/types.hpp"

namespace itr {

/// Sign of the signed volume of the simplex: +1 positive orientation, 0 degenerate, -1 inverted. Exact.
int orientation(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c);
int orientation(const Vec<3>& a, const Vec<3>& b, const Vec<3>& c, const Vec<3>& d);

/// Whether the closed segments a b and c d share a point. Exact.
bool segments_intersect(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c, const Vec<2>& d);
/// Whether the closed segment a b, of positive length, has the point p. Exact.
bool segment_contains(const Vec<2>& a, const Vec<2>& b, const Vec<2>& p);
/// Whether the closed triangle a b c has the point p; in 2D it is positively oriented, in 3D one of no area has none. Exact.
bool triangle_contains(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c, const Vec<2>& p);
bool triangle_contains(const Vec<3>& a, const Vec<3>& b, const Vec<3>& c, const Vec<3>& p);
/// Whether the closed segment p q and the closed triangle a b c share a point. Exact.
bool segment_intersects_triangle(const Vec<3>& p, const Vec<3>& q, const Vec<3>& a, const Vec<3>& b, const Vec<3>& c);

}  // namespace itr
