// SPDX-License-Identifier: MIT
#include "blocking_pairs.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "core/parallel_reduce.hpp"
#include "pairs.hpp"

namespace itr {

namespace {

constexpr std::size_t kBlock = 64;

/// Normal of a pair's line or plane, not of unit length.
template <int Dim>
Vec<Dim> span_normal(PairKind kind, const Positions<Dim>& p) {
  if constexpr (Dim == 2) {
    const Vec<2> edge = p[2] - p[1];
    return {-edge[1], edge[0]};
  } else {
    return kind == PairKind::face_vertex ? (p[2] - p[1]).cross(p[3] - p[1]) : (p[1] - p[0]).cross(p[3] - p[2]);
  }
}

/// The signed gap of a pair at the end of its way, of which `fraction` is free, linearised there: over the line or plane of
/// its primitives where their insides meet, else along the direction in which their closest features meet.
template <int Dim>
BlockingPairs::Bound bound_gap(PairKind kind, const std::array<int, 4>& vertices, const Positions<Dim>& p,
                               const Positions<Dim>& motion, double fraction, double dhat) {
  constexpr double kDegenerate = 1e-3, kKept = 0.5, kKeptOfWide = 0.3;  // the last is above what CCD keeps
  const int size = pair_size(kind);
  Positions<Dim> hit, end;
  for (int k = 0; k < size; ++k) {
    hit[k] = p[k] + fraction * motion[k];
    end[k] = p[k] + motion[k];
  }
  const ClosestFeatures features = closest_features<Dim>(kind, hit.data());
  Positions<Dim> closest;
  for (int k = 0; k < pair_size(features.kind); ++k) closest[k] = hit[features.local[k]];
  const PairDistance<Dim> distance = pair_distance<Dim>(features.kind, closest.data());
  Vec<Dim> normal = distance.separation.normalized();
  Vec<4> weights = Vec<4>::Zero();
  for (int k = 0; k < pair_size(features.kind); ++k) weights[features.local[k]] = distance.coefficients[k];
  if (features.kind == kind) {
    const Vec<Dim> before = span_normal<Dim>(kind, hit), after = span_normal<Dim>(kind, end);
    if (after.norm() > kDegenerate * before.norm()) {
      normal = (before.dot(normal) < 0 ? -1 : 1) * after.normalized();
      weights = pair_distance<Dim>(kind, end.data()).coefficients;
    }
  }
  BlockingPairs::Bound bound;
  double gap = 0;
  for (int k = 0; k < size; ++k) {
    gap += weights[k] * normal.dot(end[k]);
    for (int c = 0; c < Dim; ++c) {
      bound.dofs.push_back(Dim * vertices[k] + c);
      bound.coefficients.push_back(weights[k] * normal[c]);
    }
  }
  const double start = std::sqrt(pair_distance_squared<Dim>(kind, p.data()));
  bound.missing = std::max(kKeptOfWide * start, kKept * std::min(start, dhat)) - gap;
  return bound;
}

/// A pair that stops a motion: kind and primitives as in BlockingPairs.
struct StoppedPair {
  double free;  ///< fraction of the motion
  std::array<int, 3> pair;
};

/// The pairs that stop a motion first, each where it moves: of pairs with a moving vertex in common, or with neighbours,
/// only the first. Bounds on the others are nearly the same.
template <int Dim>
std::vector<StoppedPair> first_of_neighbours(const CollisionSurface& surface, std::vector<StoppedPair> stopped) {
  std::ranges::stable_sort(stopped, {}, &StoppedPair::free);
  std::vector<char> is_taken(surface.counts.size());
  std::vector<int> moving;
  std::erase_if(stopped, [&](const StoppedPair& one) {
    const auto kind = static_cast<PairKind>(one.pair[0]);
    const auto vertices = vertices_of(surface, kind, {one.pair[1], one.pair[2]});
    moving.clear();
    for (int k = 0; k < pair_size(kind); ++k)
      if (surface.counts[vertices[k]]) moving.push_back(vertices[k]);
    if (std::ranges::any_of(moving, [&](int v) { return is_taken[v] != 0; })) return true;
    for (const int v : moving) {
      is_taken[v] = 1;
      if constexpr (Dim == 3)
        for (const int e : surface.vertex_edges[v]) is_taken[surface.edges[e][0]] = is_taken[surface.edges[e][1]] = 1;
    }
    return false;
  });
  return stopped;
}

}  // namespace

template <int Dim>
bool find_blocking_pairs(const CollisionSurface& surface, const ContactCandidates<Dim>& candidates, ConstVectorView x,
                         ConstVectorView dx, double fraction, double dhat, BlockingPairs& blocking) {
  struct PairMotion {
    std::array<int, 4> vertices;
    Positions<Dim> from, motion;
    double free_fraction_of(PairKind kind, double part) const {
      Positions<Dim> to;
      for (int k = 0; k < pair_size(kind); ++k) to[k] = from[k] + part * motion[k];
      return free_fraction<Dim>(kind, from, to);
    }
  };
  const auto pair_motion_of = [&](PairKind kind, const std::array<int, 2>& pair) {
    const auto vertices = vertices_of(surface, kind, pair);
    const int size = pair_size(kind);
    return PairMotion{vertices, gather<Dim>(vertices, size, x), gather<Dim>(vertices, size, dx)};
  };
  std::vector<StoppedPair> stopped;
  for (const auto& [kind, list] : candidates.all()) {
    const auto& pairs = *list;
    const auto free_fraction_of = [&, kind = kind](std::size_t i) {
      return pair_motion_of(kind, pairs[i]).free_fraction_of(kind, fraction);
    };
    const auto note = [&, kind = kind](std::size_t i, double free) {
      const std::array<int, 3> pair{static_cast<int>(kind), pairs[i][0], pairs[i][1]};
      if (free < 1 && std::find(blocking.pairs.begin(), blocking.pairs.end(), pair) == blocking.pairs.end())
        stopped.push_back({free, pair});
    };
    parallel_then_ordered<double>(pairs.size(), kBlock, free_fraction_of, note);
  }
  if (blocking.pairs.size() + stopped.size() > BlockingPairs::kMost) {
    if (!blocking.takes_first) return false;
    stopped = first_of_neighbours<Dim>(surface, stopped);
    stopped.resize(std::min(stopped.size(), BlockingPairs::kMost - blocking.pairs.size()));
  }
  for (const StoppedPair& one : stopped) blocking.pairs.push_back(one.pair);
  blocking.bounds.clear();
  for (const auto& [kind_index, first, second] : blocking.pairs) {
    const auto kind = static_cast<PairKind>(kind_index);
    const PairMotion motion = pair_motion_of(kind, {first, second});
    blocking.bounds.push_back(
        bound_gap<Dim>(kind, motion.vertices, motion.from, motion.motion, motion.free_fraction_of(kind, 1), dhat));
  }
  return true;
}

#define ITR_INSTANTIATE(Dim)                                                                                 \
  template bool find_blocking_pairs(const CollisionSurface&, const ContactCandidates<Dim>&, ConstVectorView, \
                                    ConstVectorView, double, double, BlockingPairs&);
ITR_BOTH_DIMENSIONS(ITR_INSTANTIATE)

}  // namespace itr
