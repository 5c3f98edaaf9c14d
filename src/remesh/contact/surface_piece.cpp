// SPDX-License-Identifier: MIT
#include "surface_piece.hpp"

#include <cmath>

namespace itr {

namespace {

/// The largest distance between two boxes along an axis; negative where they overlap. Most pairs are apart, and this is
/// cheap.
template <int Dim>
double gap(const Box<Dim>& a, const Box<Dim>& b) {
  return std::max((a.min - b.max).maxCoeff(), (b.min - a.max).maxCoeff());
}
template <int Dim>
double gap(const Vec<Dim>& p, const Box<Dim>& box) {
  return gap<Dim>(Box<Dim>{p, p}, box);
}

/// Calls visit(squared distance) for pairs of primitives that may be within `reach`, which it gives back as it is then;
/// negative where it wants no more.
template <typename Visit>
void visit_vertices(const SurfacePiece<2>& a, const SurfacePiece<2>& b, double& reach, const Visit& visit) {
  if (b.size < 2) return;
  for (int k = 0; k < a.size && reach >= 0; ++k)
    if (gap<2>(a.p[k], b.box) <= reach && !b.has(a.id[k]))
      reach = visit(point_edge_distance_squared<2>(a.p[k], b.p[0], b.p[1]));
}

template <typename Visit>
void visit_vertices(const SurfacePiece<3>& a, const SurfacePiece<3>& b, double& reach, const Visit& visit) {
  if (b.size < 3) return;
  for (int k = 0; k < a.size && reach >= 0; ++k)
    if (gap<3>(a.p[k], b.box) <= reach && !b.has(a.id[k]))
      reach = visit(point_triangle_distance_squared(a.p[k], b.p[0], b.p[1], b.p[2]));
}

template <typename Visit>
void visit_edges(const SurfacePiece<3>& a, const SurfacePiece<3>& b, double& reach, const Visit& visit) {
  const auto number = [](const SurfacePiece<3>& piece) { return piece.size == 3 ? 3 : piece.size - 1; };
  std::array<Box<3>, 3> boxes;
  for (int j = 0; j < number(b); ++j) {
    boxes[j].include(b.p[j]);
    boxes[j].include(b.p[(j + 1) % b.size]);
  }
  for (int i = 0; i < number(a); ++i) {
    const int i1 = (i + 1) % a.size;
    Box<3> box;
    box.include(a.p[i]);
    box.include(a.p[i1]);
    if (gap(box, b.box) > reach) continue;
    for (int j = 0; j < number(b) && reach >= 0; ++j) {
      if (gap(box, boxes[j]) > reach) continue;
      const int j1 = (j + 1) % b.size;
      const bool meet = a.id[i] == b.id[j] || a.id[i] == b.id[j1] || a.id[i1] == b.id[j] || a.id[i1] == b.id[j1];
      if (!meet) reach = visit(edge_edge_distance_squared(a.p[i], a.p[i1], b.p[j], b.p[j1]));
    }
  }
}

template <int Dim, typename Visit>
void visit_pairs(const SurfacePiece<Dim>& a, const SurfacePiece<Dim>& b, double reach, const Visit& visit) {
  visit_vertices(a, b, reach, visit);
  visit_vertices(b, a, reach, visit);
  if constexpr (Dim == 3) visit_edges(a, b, reach, visit);
}

}  // namespace

template <int Dim>
double distance_below(const SurfacePiece<Dim>& a, const SurfacePiece<Dim>& b, double limit) {
  if (!a.box.inflated(limit).overlaps(b.box)) return limit;
  visit_pairs(a, b, limit, [&](double squared) {
    if (squared < limit * limit) limit = std::sqrt(squared);
    return limit;
  });
  return limit;
}

template <int Dim>
bool come_near(const SurfacePiece<Dim>& a, const SurfacePiece<Dim>& b, double reach) {
  if (!a.box.inflated(reach).overlaps(b.box)) return false;
  bool near = false;
  visit_pairs(a, b, reach, [&](double squared) {
    near = squared < reach * reach;
    return near ? -1.0 : reach;
  });
  return near;
}

#define ITR_INSTANTIATE(Dim)                                                                  \
  template double distance_below(const SurfacePiece<Dim>&, const SurfacePiece<Dim>&, double); \
  template bool come_near(const SurfacePiece<Dim>&, const SurfacePiece<Dim>&, double);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
