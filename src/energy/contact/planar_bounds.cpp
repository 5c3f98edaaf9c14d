// SPDX-License-Identifier: MIT
#include "planar_bounds.hpp"

#include <algorithm>
#include <limits>

namespace itr {

namespace {

constexpr double kKeptGap = 0.5;  ///< of the gap, or of the activation distance where the gap is wider

}  // namespace

template <int Dim>
std::array<double, 4> planar_shares(PairKind kind, const Positions<Dim>& p, const Positions<Dim>& way, double dhat) {
  std::array<double, 4> shares{1, 1, 1, 1};
  const int size = pair_size(kind), first = size_of_first(kind);
  Positions<Dim> q;
  for (int k = 0; k < size; ++k) q[k] = p[k] + way[k];
  if (!ways_overlap<Dim>(kind, p, q)) return shares;
  const ClosestFeatures closest = closest_features<Dim>(kind, p.data());
  Positions<Dim> features;
  for (int k = 0; k < pair_size(closest.kind); ++k) features[k] = p[closest.local[k]];
  Vec<Dim> normal = pair_distance<Dim>(closest.kind, features.data()).separation;
  const double distance = normal.norm();
  if (!(distance > 0)) return {0, 0, 0, 0};
  normal /= distance;
  // Heights over the second primitive, of the first one; the vertices' ways towards the other.
  if (normal.dot(p[0] - p[first]) < 0) normal = -normal;
  std::array<double, 4> height, approach;
  double low = std::numeric_limits<double>::infinity(), high = -low;
  double first_approach = 0, second_approach = 0;
  for (int k = 0; k < size; ++k) {
    height[k] = normal.dot(p[k] - p[0]);
    approach[k] = (k < first ? -1 : 1) * normal.dot(way[k]);
    if (k < first) {
      low = std::min(low, height[k]);
      first_approach = std::max(first_approach, approach[k]);
    } else {
      high = std::max(high, height[k]);
      second_approach = std::max(second_approach, approach[k]);
    }
  }
  const double gap = low - high;
  const double room = gap - kKeptGap * std::min(gap, dhat);
  const double total = first_approach + second_approach;
  if (total <= room) return shares;
  for (int k = 0; k < size; ++k) {
    if (approach[k] <= 0) continue;
    const double own =
        k < first ? height[k] - low + room * first_approach / total : high - height[k] + room * second_approach / total;
    shares[k] = std::clamp(own / approach[k], 0.0, 1.0);
  }
  return shares;
}

template std::array<double, 4> planar_shares<2>(PairKind, const Positions<2>&, const Positions<2>&, double);
template std::array<double, 4> planar_shares<3>(PairKind, const Positions<3>&, const Positions<3>&, double);

}  // namespace itr
