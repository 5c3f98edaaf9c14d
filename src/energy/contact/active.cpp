// SPDX-License-Identifier: MIT
// Which pairs act, and with which weights (docs/theory.md, "Contact"): every pair of primitives once, or area weights (and
// inclusion-exclusion where the regions of neighbouring primitives overlap: faces - edges + vertices).
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <tuple>

#include "candidates.hpp"
#include "core/parallel.hpp"
#include "energy/contact/contact.hpp"

namespace itr {

namespace {

constexpr std::size_t kBlock = 256;
constexpr double kMollifierRatio = 1e-3;  ///< of |u|^2 |v|^2 at rest

using Ids = std::array<int, 2>;

template <int Dim>
Vec<Dim> at(ConstVectorView x, int v) {
  return x.segment<Dim>(Dim * v);
}

auto sort_key(const ContactStencil& s) {
  return std::tie(s.kind, s.vertices, s.mollifier_threshold, s.closest.kind, s.closest.local);
}

/// Sums the weights of stencils of the same features, in the order in which they came; drops those that cancel. What is left
/// is sorted by features. `order` is scratch.
void merge(const std::vector<ContactStencil>& stencils, std::vector<int>& order, std::vector<ContactStencil>& merged) {
  order.resize(stencils.size());
  std::iota(order.begin(), order.end(), 0);
  parallel_sort(order, [&](int i, int j) {
    const auto p = sort_key(stencils[i]), q = sort_key(stencils[j]);
    return p < q || (p == q && i < j);
  });
  merged.clear();
  for (std::size_t i = 0; i < order.size();) {
    ContactStencil sum = stencils[order[i]];
    double magnitude = std::abs(sum.weight);
    for (++i; i < order.size() && sort_key(stencils[order[i]]) == sort_key(sum); ++i) {
      sum.weight += stencils[order[i]].weight;
      magnitude += std::abs(stencils[order[i]].weight);
    }
    if (std::abs(sum.weight) > 1e-14 * magnitude) merged.push_back(sum);
  }
}

void sort_unique(std::vector<Ids>& ids) {
  parallel_sort(ids, std::less<>());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
}

/// Result of one block of pairs: stencils, and features whose overlaps are to be corrected.
struct Part {
  std::vector<ContactStencil> stencils;
  std::vector<Ids> corners;       ///< (vertex, vertex), smaller first
  std::vector<Ids> vertex_edges;  ///< (edge, vertex)
  double least_squared = std::numeric_limits<double>::infinity();
  void clear() {
    stencils.clear();
    corners.clear();
    vertex_edges.clear();
    least_squared = std::numeric_limits<double>::infinity();
  }
};

/// Memory of a search, for the next one.
struct ActiveLists {
  Part all;
  std::vector<Part> parts;
  std::vector<int> order;
};

/// Takes what `visit(i, part)` adds to a part per block, in the order of i. The memory of `parts` is used again.
template <typename Visit, typename Take>
void visit_blocks(std::size_t n, std::vector<Part>& parts, const Visit& visit, const Take& take) {
  const std::size_t blocks = (n + kBlock - 1) / kBlock;
  if (parts.size() < blocks) parts.resize(blocks);
  parallel_blocks(n, kBlock, [&](std::size_t begin, std::size_t end) {
    Part& part = parts[begin / kBlock];
    part.clear();
    for (std::size_t i = begin; i < end; ++i) visit(i, part);
  });
  for (std::size_t i = 0; i < blocks; ++i) take(parts[i]);
}

/// The set of active pairs of one configuration.
template <int Dim>
class ActiveSet {
 public:
  ActiveSet(const CollisionSurface& surface, ConstVectorView x, double dhat, bool convergent, ActiveLists& lists)
      : lists_(lists),
        surface_(surface),
        x_(x),
        reach_squared_(dhat * dhat),
        convergent_(convergent),
        unit_(convergent ? 1 / (dhat * dhat * dhat) : 1) {
    lists_.all.clear();
  }

  void find(const ContactCandidates<Dim>& candidates, std::vector<ContactStencil>& found) {
    if constexpr (Dim == 2) {
      add_vertex_edges(candidates.vertex_edges());
    } else {
      add_vertex_triangles(candidates.vertex_triangles());
      add_edge_edges(candidates.edge_edges());
    }
    merge(stencils_, lists_.order, found);
  }
  /// Distance over all pairs found; infinity where there are none.
  double least_squared() const { return lists_.all.least_squared; }

 private:
  bool counts(int v) const { return surface_.counts[v]; }
  bool counts(int edge, int v) const {
    return counts(v) || counts(surface_.edges[edge][0]) || counts(surface_.edges[edge][1]);
  }
  bool is_near(int edge, int v) const {
    const auto [a, b] = surface_.edges[edge];
    return point_edge_distance_squared<Dim>(at<Dim>(x_, v), at<Dim>(x_, a), at<Dim>(x_, b)) < reach_squared_;
  }
  /// Tells whether a candidate is within reach, and lets it count for the least distance then.
  bool is_near(PairKind kind, const std::array<Vec<Dim>, 4>& p, Part& part) const {
    if (!(box_distance_squared<Dim>(kind, p.data()) < reach_squared_)) return false;
    const double squared = pair_distance_squared<Dim>(kind, p.data());
    if (!(squared < reach_squared_)) return false;
    part.least_squared = std::min(part.least_squared, squared);
    return true;
  }
  bool are_near(int p, int q) const { return (at<Dim>(x_, p) - at<Dim>(x_, q)).squaredNorm() < reach_squared_; }
  bool are_adjacent(int p, int q) const {
    return std::binary_search(surface_.edges.begin(), surface_.edges.end(), Ids{std::min(p, q), std::max(p, q)});
  }

  /// The pair with these vertices, reduced to its closest features.
  ContactStencil reduced(const std::array<int, 4>& vertices, const ClosestFeatures& closest, double weight) const {
    ContactStencil s;
    s.kind = closest.kind;
    s.weight = weight * unit_;
    for (int k = 0; k < s.size(); ++k) s.vertices[k] = vertices[closest.local[k]];
    if (s.kind == PairKind::vertex_vertex && s.vertices[0] > s.vertices[1]) std::swap(s.vertices[0], s.vertices[1]);
    if (s.kind == PairKind::edge_vertex && s.vertices[1] > s.vertices[2]) std::swap(s.vertices[1], s.vertices[2]);
    return s;
  }

  ContactStencil reduced(PairKind kind, const std::array<int, 4>& vertices, double weight) const {
    std::array<Vec<Dim>, 4> p;
    for (int k = 0; k < pair_size(kind); ++k) p[k] = at<Dim>(x_, vertices[k]);
    return reduced(vertices, closest_features<Dim>(kind, p.data()), weight);
  }

  ContactStencil edge_vertex(int edge, int v, double weight) const {
    return reduced(PairKind::edge_vertex, {v, surface_.edges[edge][0], surface_.edges[edge][1], kNone}, weight);
  }

  void take(const Part& part) {
    stencils_.insert(stencils_.end(), part.stencils.begin(), part.stencils.end());
    corners_.insert(corners_.end(), part.corners.begin(), part.corners.end());
    vertex_edges_.insert(vertex_edges_.end(), part.vertex_edges.begin(), part.vertex_edges.end());
    lists_.all.least_squared = std::min(lists_.all.least_squared, part.least_squared);
  }

  void add_corner(int v, int corner, Part& part) const {
    if ((counts(v) || counts(corner)) && are_near(v, corner))
      part.corners.push_back({std::min(v, corner), std::max(v, corner)});
  }

  void add_vertex_edges(const std::vector<Ids>& pairs) {
    const auto visit = [&](std::size_t i, Part& part) {
      const auto [v, e] = pairs[i];
      const auto [a, b] = surface_.edges[e];
      if (!is_near(PairKind::edge_vertex, {at<Dim>(x_, v), at<Dim>(x_, a), at<Dim>(x_, b)}, part)) return;
      part.stencils.push_back(edge_vertex(e, v, convergent_ ? surface_.area[v] / 2 : 1));
      if (convergent_)
        for (const int q : surface_.edges[e]) add_corner(v, q, part);
    };
    visit_blocks(pairs.size(), lists_.parts, visit, [&](const Part& part) { take(part); });
    sort_unique(corners_);
    for (const Ids& ids : corners_) {
      const int i = ids[0], j = ids[1];  // named by themselves: clang before 16 captures no structured bindings
      const bool adjacent = are_adjacent(i, j);
      const auto correct = [&](int vertex, int corner) {  // the corner's edges count the vertex n times
        const int n = surface_.degree[corner] - (adjacent ? 1 : 0);
        if (n > 1) stencils_.push_back(vertex_vertex(i, j, (1 - n) * surface_.area[vertex] / 2));
      };
      correct(i, j);
      correct(j, i);
    }
  }

  ContactStencil vertex_vertex(int i, int j, double weight) const {
    return {PairKind::vertex_vertex, {i, j, kNone, kNone}, weight * unit_, 0, {}};
  }

  void add_vertex_triangles(const std::vector<Ids>& pairs) {
    const auto visit = [&](std::size_t i, Part& part) {
      const auto [v, f] = pairs[i];
      const auto& t = surface_.triangles[f];
      const std::array<Vec<Dim>, 4> p{at<Dim>(x_, v), at<Dim>(x_, t[0]), at<Dim>(x_, t[1]), at<Dim>(x_, t[2])};
      if (!is_near(PairKind::face_vertex, p, part)) return;
      const auto closest = closest_features<Dim>(PairKind::face_vertex, p.data());
      part.stencils.push_back(reduced({v, t[0], t[1], t[2]}, closest, convergent_ ? surface_.area[v] / 4 : 1));
      if (!convergent_) return;
      for (int k = 0; k < 3; ++k) {
        const int e = surface_.triangle_edges[f][k];
        if (counts(e, v) && is_near(e, v)) part.vertex_edges.push_back({e, v});
        add_corner(v, t[k], part);
      }
    };
    visit_blocks(pairs.size(), lists_.parts, visit, [&](const Part& part) { take(part); });
    sort_unique(vertex_edges_);
    for (const auto& [e, v] : vertex_edges_) {  // the edge's triangles count the vertex n times
      const auto opposites = surface_.edge_opposites[e];
      const auto n = std::count_if(opposites.begin(), opposites.end(), [v = v](int o) { return o != v; });
      if (n > 1) stencils_.push_back(edge_vertex(e, v, static_cast<double>(1 - n) * surface_.area[v] / 4));
    }
    vertex_edges_.clear();
    sort_unique(corners_);
    for (const auto& [i, j] : corners_) {  // triangles around a corner minus the edges between them leave none
      if (are_adjacent(i, j)) continue;
      if (!surface_.on_open_boundary[j]) stencils_.push_back(vertex_vertex(i, j, surface_.area[i] / 4));
      if (!surface_.on_open_boundary[i]) stencils_.push_back(vertex_vertex(i, j, surface_.area[j] / 4));
    }
    corners_.clear();
  }

  double mollifier_threshold(int a, int b) const {
    return kMollifierRatio * surface_.edge_length_squared[a] * surface_.edge_length_squared[b];
  }

  /// Positions and ids of two edges, smaller index first.
  struct EdgePair {
    std::array<int, 4> vertices;
    std::array<Vec<3>, 4> p;
  };
  EdgePair edge_pair(int a, int b) const {
    const auto [a0, a1] = surface_.edges[a];
    const auto [b0, b1] = surface_.edges[b];
    return {{a0, a1, b0, b1}, {at<3>(x_, a0), at<3>(x_, a1), at<3>(x_, b0), at<3>(x_, b1)}};
  }

  ContactStencil mollified(const EdgePair& pair, const ClosestFeatures& closest, double threshold, double weight) const {
    return {PairKind::edge_edge, pair.vertices, weight * unit_, threshold, closest};
  }

  void add_edge_edges(const std::vector<Ids>& pairs) {
    const auto visit = [&](std::size_t i, Part& part) {
      const auto [a, b] = pairs[i];
      const EdgePair pair = edge_pair(a, b);
      if (!is_near(PairKind::edge_edge, pair.p, part)) return;
      const auto closest = closest_features<3>(PairKind::edge_edge, pair.p.data());
      const double threshold = mollifier_threshold(a, b);
      const double weight = convergent_ ? (surface_.edge_area[a] + surface_.edge_area[b]) / 4 : 1;
      part.stencils.push_back(edge_cross_squared(pair.p.data()) < threshold ? mollified(pair, closest, threshold, weight)
                                                                            : reduced(pair.vertices, closest, weight));
      if (!convergent_) return;
      for (const auto& [e, other] : {Ids{a, b}, Ids{b, a}})
        for (const int v : surface_.edges[other])
          if (counts(e, v) && is_near(e, v)) part.vertex_edges.push_back({e, v});
    };
    visit_blocks(pairs.size(), lists_.parts, visit, [&](const Part& part) { take(part); });
    sort_unique(vertex_edges_);
    const auto remove = [&](std::size_t i, Part& part) { remove_overlap(vertex_edges_[i][0], vertex_edges_[i][1], part); };
    visit_blocks(vertex_edges_.size(), lists_.parts, remove,
                 [&](const Part& part) { stencils_.insert(stencils_.end(), part.stencils.begin(), part.stencils.end()); });
  }

  /// The edges at v count the edge e more than once where v is what is closest to it.
  void remove_overlap(int e, int v, Part& part) const {
    const double weight = surface_.edge_area[e] / 4;
    int not_parallel = 0;
    for (const int f : surface_.vertex_edges[v]) {
      const int end = surface_.edges[f][0] == v ? surface_.edges[f][1] : surface_.edges[f][0];
      if (end == surface_.edges[e][0] || end == surface_.edges[e][1]) continue;
      const double threshold = mollifier_threshold(e, f);
      const EdgePair pair = edge_pair(std::min(e, f), std::max(e, f));
      if (edge_cross_squared(pair.p.data()) >= threshold) {
        ++not_parallel;
        continue;
      }
      part.stencils.push_back(mollified(pair, features_of_edge_and_vertex(pair, e, v), threshold, -weight));
    }
    if (not_parallel != 1) part.stencils.push_back(edge_vertex(e, v, (1 - not_parallel) * weight));
  }

  /// Finds the closest features of the edge e and the vertex v of the pair's other edge, as features of the pair.
  ClosestFeatures features_of_edge_and_vertex(const EdgePair& pair, int e, int v) const {
    const auto local = [&](int vertex) {
      return static_cast<signed char>(std::find(pair.vertices.begin(), pair.vertices.end(), vertex) - pair.vertices.begin());
    };
    const std::array<signed char, 3> places{local(v), local(surface_.edges[e][0]), local(surface_.edges[e][1])};
    const std::array<Vec<3>, 3> p{pair.p[places[0]], pair.p[places[1]], pair.p[places[2]]};
    ClosestFeatures closest = closest_features<3>(PairKind::edge_vertex, p.data());
    for (int k = 0; k < pair_size(closest.kind); ++k) closest.local[k] = places[closest.local[k]];
    return closest;
  }

  ActiveLists& lists_;
  const CollisionSurface& surface_;
  ConstVectorView x_;
  double reach_squared_;
  bool convergent_;
  double unit_;
  std::vector<ContactStencil>& stencils_ = lists_.all.stencils;
  std::vector<Ids>&corners_ = lists_.all.corners, &vertex_edges_ = lists_.all.vertex_edges;
};

}  // namespace

template <int Dim>
void ContactEnergy<Dim>::find_active(ConstVectorView x, Workspace& workspace, Active& active) const {
  auto& candidates = workspace.get<ContactCandidates<Dim>>();
  candidates.update(*surface_, x, dhat_);
  ActiveSet<Dim> set(*surface_, x, dhat_, convergent_, workspace.get<ActiveLists>());
  set.find(candidates, active.stencils);
  active.least_squared = set.least_squared();
}

template void ContactEnergy<2>::find_active(ConstVectorView, Workspace&, Active&) const;
template void ContactEnergy<3>::find_active(ConstVectorView, Workspace&, Active&) const;

}  // namespace itr
