// SPDX-License-Identifier: MIT
#include "candidates.hpp"

#include <algorithm>

#include "itr/core/parallel.hpp"

namespace itr {

namespace {

constexpr std::size_t kBlock = 128;
constexpr double kWasteful = 4;           ///< boxes this much roomier than a motion needs are made anew
constexpr std::size_t kFewPairs = 16384;  ///< so many are looked at one by one: cheaper than a tree

template <int Dim>
Vec<Dim> at(ConstVectorView x, int v) {
  return x.segment<Dim>(Dim * v);
}

template <int Dim, std::size_t N>
void get_boxes(const std::vector<std::array<int, N>>& primitives, const std::vector<Box<Dim>>& vertex_boxes,
               std::vector<Box<Dim>>& boxes) {
  boxes.assign(primitives.size(), {});
  for (std::size_t i = 0; i < primitives.size(); ++i)
    for (const int v : primitives[i]) boxes[i].include(vertex_boxes[v]);
}

/// Appends to `all` what find(i, hits, pairs) for i < n appends to `pairs`, in the order of i. `hits` is scratch.
template <typename Find>
void collect(std::size_t n, const Find& find, std::vector<std::array<int, 2>>& all) {
  std::vector<std::vector<std::array<int, 2>>> found((n + kBlock - 1) / kBlock);
  parallel_blocks(n, kBlock, [&](std::size_t begin, std::size_t end) {
    std::vector<int> hits;
    for (std::size_t i = begin; i < end; ++i) find(static_cast<int>(i), hits, found[begin / kBlock]);
  });
  for (const auto& some : found) all.insert(all.end(), some.begin(), some.end());
}

/// What overlaps the box, ascending: pairs, and with them the bits of CCD, do not depend on how a tree came about.
template <int Dim>
void find_overlaps(const Bvh<Dim>& tree, const Box<Dim>& box, std::vector<int>& hits) {
  hits.clear();
  tree.query(box, hits);
  std::sort(hits.begin(), hits.end());
}

bool counts(const CollisionSurface& surface, int v) { return surface.counts[v]; }
template <std::size_t N>
bool counts(const CollisionSurface& surface, const std::array<int, N>& primitive) {
  return std::any_of(primitive.begin(), primitive.end(), [&](int v) { return surface.counts[v]; });
}

template <std::size_t N>
bool contains(const std::array<int, N>& primitive, int v) {
  return std::find(primitive.begin(), primitive.end(), v) != primitive.end();
}

/// How many of these count.
template <typename Primitives>
std::size_t number_that_counts(const CollisionSurface& surface, const Primitives& primitives) {
  return static_cast<std::size_t>(
      std::count_if(primitives.begin(), primitives.end(), [&](const auto& p) { return counts(surface, p); }));
}

/// Whether pairs of these with the vertices are so few, of what counts with everything.
template <std::size_t N>
bool are_few(const CollisionSurface& surface, const std::vector<std::array<int, N>>& primitives) {
  const auto& vertices = surface.vertices;
  return number_that_counts(surface, vertices) * primitives.size() +
             vertices.size() * number_that_counts(surface, primitives) <
         kFewPairs;
}
bool are_few_edge_pairs(const CollisionSurface& surface) {
  return number_that_counts(surface, surface.edges) * surface.edges.size() < kFewPairs;
}

/// (vertex, primitive) for all that overlap, share no vertex, and of which one counts. `tree` is not needed for few pairs.
template <int Dim, std::size_t N>
void find_vertex_pairs(const CollisionSurface& surface, const std::vector<std::array<int, N>>& primitives,
                       const std::vector<Box<Dim>>& vertex_boxes, const std::vector<Box<Dim>>& boxes, const Bvh<Dim>& tree,
                       BoxTable<Dim>& table, std::vector<std::array<int, 2>>& pairs) {
  pairs.clear();
  const auto matters = [&](int v, int i) {
    return !contains(primitives[i], v) && (counts(surface, v) || counts(surface, primitives[i]));
  };
  Box<Dim> counting;  // what does not count only meets what does
  for (std::size_t i = 0; i < primitives.size(); ++i)
    if (counts(surface, primitives[i])) counting.include(boxes[i]);
  if (are_few(surface, primitives)) {
    table.reset(boxes);
    for (const int v : surface.vertices)
      if (counts(surface, v) || vertex_boxes[v].overlaps(counting))
        table.visit_overlaps(vertex_boxes[v], [&](int i) {
          if (matters(v, i)) pairs.push_back({v, i});
        });
    return;
  }
  const auto find = [&](int k, std::vector<int>& hits, std::vector<std::array<int, 2>>& found) {
    const int v = surface.vertices[k];
    if (!counts(surface, v) && !vertex_boxes[v].overlaps(counting)) return;
    find_overlaps(tree, vertex_boxes[v], hits);
    for (const int i : hits)
      if (matters(v, i)) found.push_back({v, i});
  };
  collect(surface.vertices.size(), find, pairs);
}

template <int Dim>
void find_edge_pairs(const CollisionSurface& surface, const std::vector<Box<Dim>>& boxes, const Bvh<Dim>& tree,
                     BoxTable<Dim>& table, std::vector<std::array<int, 2>>& pairs) {
  pairs.clear();
  const auto& edges = surface.edges;
  const auto consider = [&](int e, int f, std::vector<std::array<int, 2>>& found) {
    const bool both = counts(surface, edges[f]);
    if (both ? f <= e : f == e) return;
    if (contains(edges[e], edges[f][0]) || contains(edges[e], edges[f][1])) return;
    found.push_back({std::min(e, f), std::max(e, f)});
  };
  if (are_few_edge_pairs(surface)) {
    table.reset(boxes);
    for (int e = 0; e < static_cast<int>(edges.size()); ++e)
      if (counts(surface, edges[e])) table.visit_overlaps(boxes[e], [&](int f) { consider(e, f, pairs); });
    return;
  }
  const auto find = [&](int e, std::vector<int>& hits, std::vector<std::array<int, 2>>& found) {
    if (!counts(surface, edges[e])) return;  // found from the other side, or of no account
    find_overlaps(tree, boxes[e], hits);
    for (const int f : hits) consider(e, f, found);
  };
  collect(edges.size(), find, pairs);
}

}  // namespace

template <int Dim>
double ContactCandidates<Dim>::room_for(const CollisionSurface& surface, const ConstVectorView* dx, double reach,
                                        double share) {
  double motion = 0;
  if (dx)
    for (const int v : surface.vertices) motion = std::max(motion, at<Dim>(*dx, v).norm());
  return 0.5 * reach + share * motion;
}

template <int Dim>
bool ContactCandidates<Dim>::holds(const CollisionSurface& surface, ConstVectorView x, const ConstVectorView* dx,
                                   double reach, double room) const {
  if (surface_ != &surface || revision_ != surface.revision || boxes_.size() != surface.vertices.size()) return false;
  if (searched_ != reach) return false;
  if (dx && room_ > kWasteful * room) return false;
  for (std::size_t i = 0; i < boxes_.size(); ++i) {
    const Vec<Dim> p = at<Dim>(x, surface.vertices[i]);
    if (!boxes_[i].contains(p)) return false;
    if (dx && !boxes_[i].contains(p + at<Dim>(*dx, surface.vertices[i]))) return false;
  }
  return true;
}

template <int Dim>
void ContactCandidates<Dim>::build_boxes(const CollisionSurface& surface, ConstVectorView x, const ConstVectorView* dx,
                                         double reach, double share) {
  room_ = room_for(surface, dx, reach, share);
  boxes_.assign(surface.vertices.size(), {});
  reach_.resize(surface.area.size());
  for (std::size_t i = 0; i < boxes_.size(); ++i) {
    const int v = surface.vertices[i];
    boxes_[i].include(at<Dim>(x, v));
    if (dx) boxes_[i].include(at<Dim>(x, v) + at<Dim>(*dx, v));
    boxes_[i] = boxes_[i].inflated(room_);
    reach_[v] = boxes_[i].inflated(reach / 2);
  }
}

template <int Dim>
void ContactCandidates<Dim>::update(const CollisionSurface& surface, ConstVectorView x, const ConstVectorView* dx,
                                    double reach) {
  if (!holds(surface, x, dx, reach, room_for(surface, dx, reach, kUnforeseen))) search(surface, x, dx, reach, kUnforeseen);
}

template <int Dim>
void ContactCandidates<Dim>::search(const CollisionSurface& surface, ConstVectorView x, const ConstVectorView* dx,
                                    double reach, double share) {
  const bool keep_trees = surface_ == &surface && revision_ == surface.revision;
  build_boxes(surface, x, dx, reach, share);
  surface_ = &surface;
  revision_ = surface.revision;
  searched_ = reach;
  get_boxes<Dim>(surface.edges, reach_, edge_boxes_);
  get_boxes<Dim>(surface.triangles, reach_, triangle_boxes_);
  const auto update_tree = [&](const std::vector<Box<Dim>>& boxes, bool few, Bvh<Dim>& tree) {
    if (few) return;
    if (keep_trees && tree.size() == static_cast<int>(boxes.size()))
      tree.refit(boxes);
    else
      tree.build(boxes);
  };
  const bool few_edges = Dim == 2 ? are_few(surface, surface.edges) : are_few_edge_pairs(surface);
  parallel_blocks(2, 1, [&](std::size_t task, std::size_t) {
    if (task == 0)
      update_tree(edge_boxes_, few_edges, edge_tree_);
    else
      update_tree(triangle_boxes_, are_few(surface, surface.triangles), triangle_tree_);
  });
  if constexpr (Dim == 2) {
    find_vertex_pairs<Dim>(surface, surface.edges, reach_, edge_boxes_, edge_tree_, table_, vertex_edges_);
  } else {
    find_vertex_pairs<Dim>(surface, surface.triangles, reach_, triangle_boxes_, triangle_tree_, table_, vertex_triangles_);
    find_edge_pairs<Dim>(surface, edge_boxes_, edge_tree_, table_, edge_edges_);
  }
}

template class ContactCandidates<2>;
template class ContactCandidates<3>;

}  // namespace itr
