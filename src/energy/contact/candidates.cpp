// SPDX-License-Identifier: MIT
#include "candidates.hpp"

#include <algorithm>
#include <atomic>
#include <tuple>

#include "core/parallel.hpp"
#include "core/profile.hpp"

namespace itr {

namespace {

constexpr std::size_t kBlock = 128;
constexpr double kWasteful = 4;           ///< boxes this much roomier than a motion needs are made anew
constexpr std::size_t kFewStrays = 8;     ///< a part of the vertices from which on all pairs are searched for anew
constexpr std::size_t kFewPairs = 16384;  ///< so many are looked at one by one: cheaper than a tree
constexpr std::size_t kMostPairs = 1 << 20, kMostPairsAnEdge = 64;  ///< a sum: see most_pairs()
constexpr std::size_t kMostOfRest = 4;                              ///< times the pairs at rest, where these are many
/// Room around a motion, as a fraction of the longest: where steps of a solve lead, and where a solve is expected to go.
constexpr double kUnpredicted = 0.25, kPredicted = 0.02;

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

/// Appends to `all` what find(i, hits, pairs) for i < n appends to `pairs`, in the order of i. `hits` is scratch. Returns
/// false, and appends nothing, if these are more than `most`.
template <typename Find>
bool collect(std::size_t n, std::size_t most, const Find& find, std::vector<std::array<int, 2>>& all) {
  std::vector<std::vector<std::array<int, 2>>> found((n + kBlock - 1) / kBlock);
  std::atomic<std::size_t> count = 0;
  parallel_blocks(n, kBlock, [&](std::size_t begin, std::size_t end) {
    std::vector<int> hits;
    auto& pairs = found[begin / kBlock];
    for (std::size_t i = begin; i < end && count.load(std::memory_order_relaxed) <= most; ++i) {
      const std::size_t before = pairs.size();
      find(static_cast<int>(i), hits, pairs);
      count.fetch_add(pairs.size() - before, std::memory_order_relaxed);
    }
  });
  if (count > most) return false;
  all.reserve(count);
  for (const auto& some : found) all.insert(all.end(), some.begin(), some.end());
  return true;
}

/// Finds items that overlap the box and that `matters(i)` accepts, ascending: pairs, and with them the bits of CCD, do not
/// depend on how a tree came about.
template <int Dim, typename Matters>
void find_overlaps(const Bvh<Dim>& tree, const Box<Dim>& box, const Matters& matters, std::vector<int>& hits) {
  hits.clear();
  tree.query(box, hits);
  std::erase_if(hits, [&](int i) { return !matters(i); });
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

/// Whether the pair of a vertex and a primitive (an edge in 2D, a triangle in 3D), or of two edges, can act.
template <std::size_t N>
bool matters(const CollisionSurface& surface, int v, const std::array<int, N>& primitive) {
  return !contains(primitive, v) && (counts(surface, v) || counts(surface, primitive)) &&
         !surface.closed.exclude<static_cast<int>(N)>(std::array{v}, primitive);
}
bool matters(const CollisionSurface& surface, const std::array<int, 2>& e, const std::array<int, 2>& f) {
  return !contains(e, f[0]) && !contains(e, f[1]) && (counts(surface, e) || counts(surface, f)) &&
         !surface.closed.exclude<3>(e, f);
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
/// Returns false if there are more than `most`.
template <int Dim, std::size_t N>
bool find_vertex_pairs(const CollisionSurface& surface, const std::vector<std::array<int, N>>& primitives,
                       const std::vector<Box<Dim>>& vertex_boxes, const std::vector<Box<Dim>>& boxes, const Bvh<Dim>& tree,
                       BoxTable<Dim>& table, std::size_t most, std::vector<std::array<int, 2>>& pairs) {
  pairs.clear();
  Box<Dim> counting;  // what does not count only meets what does
  for (std::size_t i = 0; i < primitives.size(); ++i)
    if (counts(surface, primitives[i])) counting.include(boxes[i]);
  if (are_few(surface, primitives)) {
    table.reset(boxes);
    for (const int v : surface.vertices)
      if (counts(surface, v) || vertex_boxes[v].overlaps(counting))
        table.visit_overlaps(vertex_boxes[v], [&](int i) {
          if (matters(surface, v, primitives[i])) pairs.push_back({v, i});
        });
    return true;
  }
  const auto find = [&](int k, std::vector<int>& hits, std::vector<std::array<int, 2>>& found) {
    const int v = surface.vertices[k];
    if (!counts(surface, v) && !vertex_boxes[v].overlaps(counting)) return;
    find_overlaps(
        tree, vertex_boxes[v], [&](int i) { return matters(surface, v, primitives[i]); }, hits);
    for (const int i : hits) found.push_back({v, i});
  };
  return collect(surface.vertices.size(), most, find, pairs);
}

template <int Dim>
bool find_edge_pairs(const CollisionSurface& surface, const std::vector<Box<Dim>>& boxes, const Bvh<Dim>& tree,
                     BoxTable<Dim>& table, std::size_t most, std::vector<std::array<int, 2>>& pairs) {
  pairs.clear();
  const auto& edges = surface.edges;
  const auto is_pair = [&](int e, int f) {  // once where both count
    return (counts(surface, edges[f]) ? e < f : e != f) && matters(surface, edges[e], edges[f]);
  };
  const auto add = [](int e, int f, std::vector<std::array<int, 2>>& to) { to.push_back({std::min(e, f), std::max(e, f)}); };
  if (are_few_edge_pairs(surface)) {
    table.reset(boxes);
    for (int e = 0; e < static_cast<int>(edges.size()); ++e)
      if (counts(surface, edges[e]))
        table.visit_overlaps(boxes[e], [&](int f) {
          if (is_pair(e, f)) add(e, f, pairs);
        });
    return true;
  }
  const auto find = [&](int e, std::vector<int>& hits, std::vector<std::array<int, 2>>& found) {
    if (!counts(surface, edges[e])) return;  // found from the other side, or of no account
    find_overlaps(
        tree, boxes[e], [&](int f) { return is_pair(e, f); }, hits);
    for (const int f : hits) add(e, f, found);
  };
  return collect(edges.size(), most, find, pairs);
}

template <std::size_t N>
bool has_any(const std::array<int, N>& primitive, const std::vector<char>& is_stray) {
  return std::any_of(primitive.begin(), primitive.end(), [&](int v) { return is_stray[v] != 0; });
}

/// Makes the boxes of primitives with strays anew, and the tree of all; returns which these are.
template <int Dim, std::size_t N>
std::vector<int> move_boxes(const std::vector<std::array<int, N>>& primitives, const std::vector<char>& is_stray,
                            const std::vector<Box<Dim>>& vertex_boxes, std::vector<Box<Dim>>& boxes, Bvh<Dim>& tree) {
  std::vector<int> moved;
  for (std::size_t i = 0; i < primitives.size(); ++i) {
    if (!has_any(primitives[i], is_stray)) continue;
    moved.push_back(static_cast<int>(i));
    boxes[i] = {};
    for (const int v : primitives[i]) boxes[i].include(vertex_boxes[v]);
  }
  tree.refit(boxes);
  return moved;
}

/// Puts `found` in the place of what `is_old`, in the order of a whole search, which `key` tells.
template <typename IsOld, typename Key>
void replace(std::vector<std::array<int, 2>>& pairs, std::vector<std::array<int, 2>>& found, const IsOld& is_old,
             const Key& key) {
  const auto is_less = [&](const auto& a, const auto& b) { return key(a) < key(b); };
  std::sort(found.begin(), found.end(), is_less);
  found.erase(std::unique(found.begin(), found.end()), found.end());
  std::erase_if(pairs, is_old);
  std::vector<std::array<int, 2>> merged(pairs.size() + found.size());
  std::merge(pairs.begin(), pairs.end(), found.begin(), found.end(), merged.begin(), is_less);
  pairs.swap(merged);
  found.clear();
}

}  // namespace

template <int Dim>
double ContactCandidates<Dim>::room_for(const CollisionSurface& surface, const ConstVectorView* dx, double reach,
                                        double fraction) {
  double motion = 0;
  if (dx)
    for (const int v : surface.vertices) motion = std::max(motion, at<Dim>(*dx, v).norm());
  return 0.5 * reach + fraction * motion;
}

/// Room around the motion of one vertex: that of all, or less where it hardly moves and another search would be small.
template <int Dim>
double ContactCandidates<Dim>::room_of(int v, const ConstVectorView* dx, double reach, double room) const {
  return dx && has_trees_ ? std::min(room, 0.5 * reach + at<Dim>(*dx, v).norm()) : room;
}

template <int Dim>
void ContactCandidates<Dim>::find_strays(const CollisionSurface& surface, ConstVectorView x, const ConstVectorView* dx,
                                         double reach, double room) {
  strays_.clear();
  for (std::size_t i = 0; i < boxes_.size(); ++i) {
    const int v = surface.vertices[i];
    const Vec<Dim> p = at<Dim>(x, v);
    const bool is_wasteful = dx && rooms_[i] > kWasteful * room_of(v, dx, reach, room);
    if (is_wasteful || !boxes_[i].contains(p) || (dx && !boxes_[i].contains(p + at<Dim>(*dx, v))))
      strays_.push_back(static_cast<int>(i));
  }
}

template <int Dim>
void ContactCandidates<Dim>::build_box(std::size_t i, int v, ConstVectorView x, const ConstVectorView* dx, double reach,
                                       double room) {
  rooms_[i] = room_of(v, dx, reach, room);
  boxes_[i] = {};
  boxes_[i].include(at<Dim>(x, v));
  if (dx) boxes_[i].include(at<Dim>(x, v) + at<Dim>(*dx, v));
  boxes_[i] = boxes_[i].inflated(rooms_[i]);
  reach_[v] = boxes_[i].inflated(reach / 2);
}

template <int Dim>
std::size_t ContactCandidates<Dim>::most_pairs(const CollisionSurface& surface) {
  return kMostPairs + kMostPairsAnEdge * surface.edges.size();
}

template <int Dim>
std::size_t ContactCandidates<Dim>::most_now(const CollisionSurface& surface) const {
  return std::max(most_pairs(surface), kMostOfRest * at_rest_);
}

template <int Dim>
double ContactCandidates<Dim>::update(const CollisionSurface& surface, ConstVectorView x, ConstVectorView dx, double reach,
                                      ScratchVector& part, double longest) {
  const ScopedPhase phase("candidates");
  if (longest == 1 && hold(surface, x, &dx, reach, most_now(surface))) return 1;
  return search_part(surface, x, dx, reach, part, std::min(longest, 0.5));
}

template <int Dim>
void ContactCandidates<Dim>::predict_motion(const CollisionSurface& surface, ConstVectorView x, ConstVectorView dx,
                                            double reach, ScratchVector& part) {
  at_rest_ = 0;
  if (!search(surface, x, &dx, reach, kPredicted, most_now(surface))) search_part(surface, x, dx, reach, part, 0.5);
}

/// Finds the pairs of the longest of dx, dx / 2, dx / 4, ..., not longer than this fraction of it, that has few enough of
/// them; returns that fraction. Motions beyond the extent of all bodies need not be tried. Below `reach`, pairs are those of
/// bodies at rest, of which none can be left out.
template <int Dim>
double ContactCandidates<Dim>::search_part(const CollisionSurface& surface, ConstVectorView x, ConstVectorView dx,
                                           double reach, ScratchVector& part, double fraction) {
  Box<Dim> around;
  for (const int v : surface.vertices) around.include(at<Dim>(x, v));
  const double longest = dx.lpNorm<Eigen::Infinity>(), extent = (around.max - around.min).maxCoeff();
  while (fraction * longest > extent + reach) fraction /= 2;
  for (;; fraction /= 2) {
    const ConstVectorView step = part.resize(dx.size()) = fraction * dx;
    const std::size_t most = step.lpNorm<Eigen::Infinity>() > reach ? most_now(surface) : kNoLimit;
    if (search(surface, x, &step, reach, kPredicted, most)) return fraction;
  }
}

template <int Dim>
bool ContactCandidates<Dim>::hold(const CollisionSurface& surface, ConstVectorView x, const ConstVectorView* dx,
                                  double reach, std::size_t most) {
  const auto search_all = [&] { return search(surface, x, dx, reach, kUnpredicted, most); };
  const bool is_known = holds_ && surface_ == &surface && revision_ == surface.revision &&
                        boxes_.size() == surface.vertices.size() && searched_ == reach;
  if (!is_known) return search_all();
  const double room = room_for(surface, dx, reach, kUnpredicted);
  find_strays(surface, x, dx, reach, room);
  if (strays_.empty()) return true;
  if (!has_trees_ || kFewStrays * strays_.size() > boxes_.size()) return search_all();
  for (const int i : strays_) build_box(i, surface.vertices[i], x, dx, reach, room);
  return replace_pairs_of_strays(surface, most) || search_all();
}

template <int Dim>
bool ContactCandidates<Dim>::replace_pairs_of_strays(const CollisionSurface& surface, std::size_t most) {
  is_stray_.assign(surface.area.size(), 0);
  for (const int i : strays_) is_stray_[surface.vertices[i]] = 1;
  Pairs found;
  std::vector<int> hits;
  const auto& [vertices, edges, triangles] = std::tie(surface.vertices, surface.edges, surface.triangles);

  const std::vector<int> moved_triangles = move_boxes(triangles, is_stray_, reach_, triangle_boxes_, triangle_tree_);
  const auto add_overlaps = [&](int v, const Bvh<Dim>& tree, const auto& triangle_of) {
    hits.clear();
    tree.query(reach_[v], hits);
    for (const int hit : hits)
      if (const int t = triangle_of(hit); matters(surface, v, triangles[t])) found.push_back({v, t});
  };
  const auto are_too_many = [&] { return found.size() / 2 > most; };  // two strays find each other twice
  for (const int i : strays_) {
    add_overlaps(vertices[i], triangle_tree_, [](int hit) { return hit; });
    if (are_too_many()) return false;
  }
  std::vector<Box<Dim>> moved_boxes;
  Box<Dim> around;
  for (const int t : moved_triangles) {
    moved_boxes.push_back(triangle_boxes_[t]);
    around.include(triangle_boxes_[t]);
  }
  const Bvh<Dim> moved_tree(moved_boxes);
  for (const int v : vertices) {
    if (is_stray_[v] == 0 && reach_[v].overlaps(around))
      add_overlaps(v, moved_tree, [&](int hit) { return moved_triangles[hit]; });
    if (are_too_many()) return false;
  }
  replace(
      vertex_triangles_, found,
      [&](const auto& pair) { return is_stray_[pair[0]] != 0 || has_any(triangles[pair[1]], is_stray_); },
      [](const auto& pair) { return pair; });

  for (const int e : move_boxes(edges, is_stray_, reach_, edge_boxes_, edge_tree_)) {
    hits.clear();
    edge_tree_.query(edge_boxes_[e], hits);
    for (const int f : hits)
      if (matters(surface, edges[e], edges[f])) found.push_back({std::min(e, f), std::max(e, f)});
    if (are_too_many()) return false;
  }
  replace(
      edge_edges_, found,
      [&](const auto& pair) { return has_any(edges[pair[0]], is_stray_) || has_any(edges[pair[1]], is_stray_); },
      [&](const auto& pair) {  // a whole search looks around edges that count
        return counts(surface, edges[pair[0]]) ? pair : std::array{pair[1], pair[0]};
      });
  return vertex_triangles_.size() <= most && edge_edges_.size() <= most;
}

template <int Dim>
bool ContactCandidates<Dim>::search(const CollisionSurface& surface, ConstVectorView x, const ConstVectorView* dx,
                                    double reach, double fraction, std::size_t most) {
  const bool keep_trees = surface_ == &surface && revision_ == surface.revision;
  if (!keep_trees) at_rest_ = 0;
  const bool few_edges = Dim == 2 ? are_few(surface, surface.edges) : are_few_edge_pairs(surface);
  const bool few_triangles = are_few(surface, surface.triangles);
  has_trees_ = Dim == 3 && !few_edges && !few_triangles;
  const double room = room_for(surface, dx, reach, fraction);
  boxes_.resize(surface.vertices.size());
  rooms_.resize(surface.vertices.size());
  reach_.resize(surface.area.size());
  for (std::size_t i = 0; i < boxes_.size(); ++i) build_box(i, surface.vertices[i], x, dx, reach, room);
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
  parallel_blocks(2, 1, [&](std::size_t task, std::size_t) {
    if (task == 0)
      update_tree(edge_boxes_, few_edges, edge_tree_);
    else
      update_tree(triangle_boxes_, few_triangles, triangle_tree_);
  });
  if constexpr (Dim == 2) {
    holds_ = find_vertex_pairs<Dim>(surface, surface.edges, reach_, edge_boxes_, edge_tree_, table_, most, vertex_edges_);
  } else {
    holds_ = find_vertex_pairs<Dim>(surface, surface.triangles, reach_, triangle_boxes_, triangle_tree_, table_, most,
                                    vertex_triangles_) &&
             find_edge_pairs<Dim>(surface, edge_boxes_, edge_tree_, table_, most, edge_edges_);
  }
  if (most == kNoLimit)
    for (const auto& [kind, list] : all()) at_rest_ = std::max(at_rest_, list->size());
  return holds_;
}

template class ContactCandidates<2>;
template class ContactCandidates<3>;

}  // namespace itr
