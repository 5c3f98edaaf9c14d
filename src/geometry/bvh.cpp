// SPDX-License-Identifier: MIT
#include "geometry/bvh.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace itr {

namespace {

constexpr int kMostWaiting = 128;  ///< nodes of a query: 7 a level, of which there are at most 11

/// Single-precision numbers below and above.
float round_down(double value) {
  constexpr float kMost = std::numeric_limits<float>::max(), kEpsilon = std::numeric_limits<float>::epsilon();
  const auto nearest = static_cast<float>(std::clamp<double>(value, -kMost, kMost));
  return nearest - (kEpsilon * std::abs(nearest) + std::numeric_limits<float>::min());
}
float round_up(double value) { return -round_down(-value); }

}  // namespace

template <int Dim>
void Bvh<Dim>::build(std::span<const Box<Dim>> boxes) {
  const int n = static_cast<int>(boxes.size());
  nodes_.clear();
  boxes_.assign(boxes.begin(), boxes.end());
  if (n == 0) return;
  std::vector<int> order(n);
  std::iota(order.begin(), order.end(), 0);
  // Puts those of smaller centres along the longest axis first, up to `middle`.
  const auto split = [&](int begin, int middle, int end) {
    Box<Dim> centers;
    for (int i = begin; i < end; ++i) centers.include(Vec<Dim>(boxes[order[i]].min + boxes[order[i]].max));
    Eigen::Index axis = 0;
    (centers.max - centers.min).maxCoeff(&axis);
    std::nth_element(order.begin() + begin, order.begin() + middle, order.begin() + end, [&](int a, int b) {
      const double ca = boxes[a].min[axis] + boxes[a].max[axis], cb = boxes[b].min[axis] + boxes[b].max[axis];
      return ca != cb ? ca < cb : a < b;
    });
  };
  const auto make_node = [&](auto&& self, int begin, int end) -> int {
    const int index = static_cast<int>(nodes_.size());
    nodes_.emplace_back();
    int share = 1;  // of a child: a power of the width, so that all nodes but the last ones are full
    while (kWidth * share < end - begin) share *= kWidth;
    for (int step = kWidth / 2 * share; step >= share; step /= 2)
      for (int first = begin; first + step < end; first += 2 * step)
        split(first, first + step, std::min(end, first + 2 * step));
    for (int k = 0; k < kWidth && begin + k * share < end; ++k) {
      const int first = begin + k * share, last = std::min(end, first + share);
      const int child = last - first == 1 ? -1 - order[first] : self(self, first, last);
      nodes_[index].child[k] = child;
      nodes_[index].count = k + 1;
    }
    return index;
  };
  make_node(make_node, 0, n);
  set_boxes();
}

template <int Dim>
void Bvh<Dim>::refit(std::span<const Box<Dim>> boxes) {
  std::copy(boxes.begin(), boxes.end(), boxes_.begin());
  set_boxes();
}

template <int Dim>
void Bvh<Dim>::set_boxes() {
  for (auto node = nodes_.rbegin(); node != nodes_.rend(); ++node)
    for (int k = 0; k < node->count; ++k)
      for (int c = 0; c < Dim; ++c) {
        const int child = node->child[k];
        if (child < 0) {
          node->min[c][k] = round_down(boxes_[-1 - child].min[c]);
          node->max[c][k] = round_up(boxes_[-1 - child].max[c]);
        } else {
          const Node& below = nodes_[child];
          float min = below.min[c][0], max = below.max[c][0];
          for (int i = 1; i < below.count; ++i) {
            min = std::min(min, below.min[c][i]);
            max = std::max(max, below.max[c][i]);
          }
          node->min[c][k] = min;
          node->max[c][k] = max;
        }
      }
}

template <int Dim>
void Bvh<Dim>::query(const Box<Dim>& box, std::vector<int>& hits) const {
  if (nodes_.empty()) return;
  std::array<float, Dim> min, max;
  for (int c = 0; c < Dim; ++c) {
    min[c] = round_down(box.min[c]);
    max[c] = round_up(box.max[c]);
  }
  std::array<int, kMostWaiting> waiting;
  int count = 0;
  waiting[count++] = 0;
  while (count > 0) {
    const Node& node = nodes_[waiting[--count]];
    auto overlaps = (node.min[0] <= max[0]) & (node.max[0] >= min[0]);
    for (int c = 1; c < Dim; ++c) overlaps &= (node.min[c] <= max[c]) & (node.max[c] >= min[c]);
    for (int k = 0; k < node.count; ++k) {
      if (overlaps[k] == 0) continue;
      const int child = node.child[k];
      if (child >= 0)
        waiting[count++] = child;
      else if (boxes_[-1 - child].overlaps(box))
        hits.push_back(-1 - child);
    }
  }
}

template class Bvh<2>;
template class Bvh<3>;

}  // namespace itr
