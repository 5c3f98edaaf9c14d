// SPDX-License-Identifier: MIT
#include "surface_index.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "remesh/curved_cell.hpp"

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

template <int Dim>
ObstaclePrimitives ObstaclePrimitives::make(const typename StepContext<Dim>::ObstacleGeometry& obstacles) {
  ObstaclePrimitives result;
  const std::size_t count = obstacles.rest.size();
  result.at_vertex.resize(count);
  std::vector<char> used(count, 0);
  std::vector<std::array<int, 2>> covered;  // edges of triangles
  const auto add = [&](Primitive primitive) {
    for (const int v : primitive.ids()) {
      used[v] = 1;
      result.at_vertex[v].push_back(static_cast<int>(result.all.size()));
    }
    result.all.push_back(primitive);
  };
  for (const auto& t : obstacles.triangles) {
    add({t, 3});
    for (int k = 0; k < 3; ++k) covered.push_back(edge_key(t[k], t[(k + 1) % 3]));
  }
  std::sort(covered.begin(), covered.end());
  for (const auto& [a, b] : obstacles.edges)
    if (!std::binary_search(covered.begin(), covered.end(), edge_key(a, b))) add({{a, b, kNone}, 2});
  for (std::size_t v = 0; v < count; ++v)
    if (!used[v]) add({{static_cast<int>(v), kNone, kNone}, 1});
  return result;
}

template <int Dim>
SurfaceIndex<Dim>::SurfaceIndex(const Mesh<Dim>& mesh, const VectorX& x, const ObstaclePrimitives& primitives,
                                const std::vector<Vec<Dim>>& obstacle_x, double span)
    : mesh_(&mesh), x_(&x), primitives_(&primitives), obstacle_x_(&obstacle_x), span_(span) {
  stamps_.assign(mesh.facet_slots(), now_);
  changed_ = stamps_;
  std::vector<Box<Dim>> boxes(mesh.facet_slots());
  for (const FacetId f : mesh.live_facets()) boxes[f] = box_of(f);
  facets_.build(boxes);
  boxes.assign(primitives.all.size(), {});
  for (std::size_t i = 0; i < boxes.size(); ++i)
    for (const int v : primitives.all[i].ids()) boxes[i].include(obstacle_x[v]);
  obstacles_.build(boxes);
}

template <int Dim>
Box<Dim> SurfaceIndex<Dim>::box_of(FacetId f) const {
  Box<Dim> box;
  for (const int v : mesh_->facet(f)) box.include(at(v));
  for_each_node_on<Dim>(mesh_->facet(f), nodes_of_edges(*mesh_), [&](VertexId node) { box.include(at(node)); });
  return box;
}

template <int Dim>
SurfacePiece<Dim> SurfaceIndex<Dim>::piece(FacetId f) const {
  SurfacePiece<Dim> piece;
  for (const int v : mesh_->facet(f)) piece.add(at(v), v);
  return piece;
}

template <int Dim>
SurfacePieces<Dim> SurfaceIndex<Dim>::pieces(FacetId f) const {
  SurfacePieces<Dim> result;
  for_each_chord<Dim>(mesh_->facet(f), nodes_of_edges(*mesh_), [&](const auto& ids) {
    SurfacePiece<Dim>& piece = result.emplace_back();
    for (const int v : ids) piece.add(at(v), v);
  });
  return result;
}

template <int Dim>
SurfacePiece<Dim> SurfaceIndex<Dim>::obstacle_piece(int primitive) const {
  SurfacePiece<Dim> piece;
  for (const int v : primitives_->all[primitive].ids()) piece.add(obstacle_at(v), SurfaceId::of_obstacle(v));
  return piece;
}

template <int Dim>
void SurfaceIndex<Dim>::query(const Box<Dim>& box, Hits& hits) const {
  hits.facets.clear();
  hits.obstacles.clear();
  facets_.query(box, hits.facets);
  obstacles_.query(box, hits.obstacles);
  std::sort(hits.facets.begin(), hits.facets.end());
  std::sort(hits.obstacles.begin(), hits.obstacles.end());
}

template <int Dim>
void SurfaceIndex<Dim>::stamp_near(const Box<Dim>& box) {
  if (span_ == 0) return;
  stamped_.clear();
  facets_.query(box.inflated(span_), stamped_);
  for (const FacetId f : stamped_) stamps_[f] = now_;
}

template <int Dim>
void SurfaceIndex<Dim>::follow(std::span<const FacetId> removed, FacetId first_new) {
  ++now_;
  stamps_.resize(mesh_->facet_slots(), now_);
  changed_.resize(mesh_->facet_slots(), now_);
  for (const FacetId f : removed) {
    changed_[f] = std::numeric_limits<unsigned>::max();
    stamp_near(facets_.box(f));
    facets_.remove(f);
  }
  for (FacetId f = first_new; f < mesh_->facet_slots(); ++f) {
    const Box<Dim> box = box_of(f);
    facets_.insert(f, box);
    stamp_near(box);
  }
}

template <int Dim>
void SurfaceIndex<Dim>::move(VertexId v) {
  ++now_;
  Box<Dim> around;
  for_each_facet_at(*mesh_, v, [&](FacetId f) {
    const Box<Dim> box = box_of(f);
    changed_[f] = now_;
    around.include(facets_.box(f));
    around.include(box);
    facets_.update(f, box);
  });
  stamp_near(around);
}

template ObstaclePrimitives ObstaclePrimitives::make<2>(const StepContext<2>::ObstacleGeometry&);
template ObstaclePrimitives ObstaclePrimitives::make<3>(const StepContext<3>::ObstacleGeometry&);
template class SurfaceIndex<2>;
template class SurfaceIndex<3>;

}  // namespace itr
