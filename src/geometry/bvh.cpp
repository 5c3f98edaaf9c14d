// SPDX-License-Identifier: MIT
#include "itr/geometry/bvh.hpp"

#include <algorithm>
#include <numeric>

namespace itr {

namespace {
constexpr int kLeafSize = 4;
constexpr int kMaxDepth = 64;  ///< median splits halve: far above log2 of any size
}  // namespace

template <int Dim>
void Bvh<Dim>::build(std::span<const Box<Dim>> boxes) {
  const int n = static_cast<int>(boxes.size());
  nodes_.clear();
  leaves_.resize(n);
  std::iota(leaves_.begin(), leaves_.end(), 0);
  if (n == 0) return;
  nodes_.reserve(2 * n / kLeafSize + 2);
  const auto make_node = [&](auto&& self, int begin, int end) -> void {
    const int index = static_cast<int>(nodes_.size());
    nodes_.emplace_back();
    Box<Dim> centers;
    for (int i = begin; i < end; ++i) {
      nodes_[index].box.include(boxes[leaves_[i]]);
      centers.include(Vec<Dim>(boxes[leaves_[i]].min + boxes[leaves_[i]].max));
    }
    if (end - begin <= kLeafSize) {
      nodes_[index].first = begin;
      nodes_[index].count = end - begin;
      return;
    }
    Eigen::Index axis = 0;
    (centers.max - centers.min).maxCoeff(&axis);
    const int middle = (begin + end) / 2;
    std::nth_element(leaves_.begin() + begin, leaves_.begin() + middle, leaves_.begin() + end, [&](int a, int b) {
      const double ca = boxes[a].min[axis] + boxes[a].max[axis], cb = boxes[b].min[axis] + boxes[b].max[axis];
      return ca != cb ? ca < cb : a < b;
    });
    self(self, begin, middle);
    nodes_[index].first = static_cast<int>(nodes_.size());
    self(self, middle, end);
  };
  make_node(make_node, 0, n);
  leaf_boxes_.resize(n);
  for (int i = 0; i < n; ++i) leaf_boxes_[i] = boxes[leaves_[i]];
}

template <int Dim>
void Bvh<Dim>::refit(std::span<const Box<Dim>> boxes) {
  for (std::size_t i = 0; i < leaves_.size(); ++i) leaf_boxes_[i] = boxes[leaves_[i]];
  for (int node = static_cast<int>(nodes_.size()) - 1; node >= 0; --node) {  // children come after their parents
    Node& current = nodes_[node];
    current.box = {};
    if (current.count > 0) {
      for (int i = 0; i < current.count; ++i) current.box.include(leaf_boxes_[current.first + i]);
    } else {
      current.box.include(nodes_[node + 1].box);
      current.box.include(nodes_[current.first].box);
    }
  }
}

template <int Dim>
void Bvh<Dim>::query(const Box<Dim>& box, std::vector<int>& hits) const {
  if (nodes_.empty()) return;
  int stack[kMaxDepth], depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const int index = stack[--depth];
    const Node& node = nodes_[index];
    if (!node.box.overlaps(box)) continue;
    if (node.count > 0) {
      for (int i = node.first; i < node.first + node.count; ++i)
        if (leaf_boxes_[i].overlaps(box)) hits.push_back(leaves_[i]);
    } else {
      stack[depth++] = node.first;
      stack[depth++] = index + 1;
    }
  }
}

template class Bvh<2>;
template class Bvh<3>;

}  // namespace itr
