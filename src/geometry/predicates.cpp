// SPDX-License-Identifier: MIT
#include "geometry/predicates.hpp"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/intersections.h>

namespace itr {

namespace {
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
Kernel::Point_2 point(const Vec<2>& p) { return {p[0], p[1]}; }
Kernel::Point_3 point(const Vec<3>& p) { return {p[0], p[1], p[2]}; }
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
  return CGAL::do_intersect(Kernel::Segment_3(point(p), point(q)), Kernel::Triangle_3(point(a), point(b), point(c)));
}

}  // namespace itr
