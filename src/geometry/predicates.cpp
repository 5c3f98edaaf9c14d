// SPDX-License-Identifier: MIT
#include "geometry/predicates.hpp"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/intersections.h>

namespace itr {

namespace {
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
Kernel::Point_2 point(const Vec<2>& p) { return {p[0], p[1]}; }
Kernel::Point_3 point(const Vec<3>& p) { return {p[0], p[1], p[2]}; }

/// Decides for points, too, which CGAL's test of segments does not take.
bool meet(const Kernel::Segment_3& s, const Kernel::Segment_3& t) {
  if (s.is_degenerate()) return t.is_degenerate() ? s.source() == t.source() : t.has_on(s.source());
  return t.is_degenerate() ? s.has_on(t.source()) : CGAL::do_intersect(s, t);
}
}  // namespace

int orientation(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c) {
  return static_cast<int>(CGAL::orientation(point(a), point(b), point(c)));
}

int orientation(const Vec<3>& a, const Vec<3>& b, const Vec<3>& c, const Vec<3>& d) {
  return static_cast<int>(CGAL::orientation(point(a), point(b), point(c), point(d)));
}

bool segments_intersect(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c, const Vec<2>& d) {
  return CGAL::do_intersect(Kernel::Segment_2(point(a), point(b)), Kernel::Segment_2(point(c), point(d)));
}

bool segment_contains(const Vec<2>& a, const Vec<2>& b, const Vec<2>& p) {
  return Kernel::Segment_2(point(a), point(b)).has_on(point(p));
}

bool triangle_contains(const Vec<3>& a, const Vec<3>& b, const Vec<3>& c, const Vec<3>& p) {
  const Kernel::Triangle_3 triangle(point(a), point(b), point(c));
  return !triangle.is_degenerate() && triangle.has_on(point(p));
}

bool triangle_contains(const Vec<2>& a, const Vec<2>& b, const Vec<2>& c, const Vec<2>& p) {
  return orientation(a, b, p) >= 0 && orientation(b, c, p) >= 0 && orientation(c, a, p) >= 0;
}

bool segment_intersects_triangle(const Vec<3>& p, const Vec<3>& q, const Vec<3>& a, const Vec<3>& b, const Vec<3>& c) {
  const Kernel::Segment_3 segment(point(p), point(q));
  const Kernel::Triangle_3 triangle(point(a), point(b), point(c));
  if (triangle.is_degenerate())
    return meet(segment, {triangle[0], triangle[1]}) || meet(segment, {triangle[1], triangle[2]}) ||
           meet(segment, {triangle[2], triangle[0]});
  return segment.is_degenerate() ? triangle.has_on(segment.source()) : CGAL::do_intersect(segment, triangle);
}

}  // namespace itr
