// SPDX-License-Identifier: MIT
#include "surface_index.hpp"

#include <algorithm>
#include <limits>

#include "remesh/curved_cell.hpp"

namespace itr {

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
