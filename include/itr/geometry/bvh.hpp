// SPDX-License-Identifier: MIT
// A static tree of axis-aligned boxes.
#pragma once

#include <functional>
#include <limits>
#include <span>
#include <vector>

#include "itr/core/types.hpp"

namespace itr {

template <int Dim>
struct Box {
  Vec<Dim> min = Vec<Dim>::Constant(std::numeric_limits<double>::infinity());
  Vec<Dim> max = Vec<Dim>::Constant(-std::numeric_limits<double>::infinity());
  void include(const Vec<Dim>& p) {
    min = min.cwiseMin(p);
    max = max.cwiseMax(p);
  }
  void include(const Box& other) {
    min = min.cwiseMin(other.min);
    max = max.cwiseMax(other.max);
  }
  Box inflated(double r) const { return {min.array() - r, max.array() + r}; }
  bool overlaps(const Box& other) const {
    return (min.array() <= other.max.array()).all() && (other.min.array() <= max.array()).all();
  }
  bool contains(const Vec<Dim>& p) const { return (min.array() <= p.array()).all() && (p.array() <= max.array()).all(); }
};

/// Built once over `boxes`; queries report the indices of boxes that overlap (closed boxes), in an order that depends on the
/// boxes only.
template <int Dim>
class Bvh {
 public:
  Bvh() = default;
  explicit Bvh(std::span<const Box<Dim>> boxes) { build(boxes); }
  void build(std::span<const Box<Dim>> boxes);
  /// Same number and order of boxes, new extents: keeps the tree, updates it in linear time.
  void refit(std::span<const Box<Dim>> boxes);
  int size() const { return static_cast<int>(leaves_.size()); }
  /// Appends to `hits` the indices of all boxes that overlap `box`.
  void query(const Box<Dim>& box, std::vector<int>& hits) const;

 private:
  struct Node {
    Box<Dim> box;
    int first = 0;  ///< leaf: first entry of leaves_; else: index of the right child (the left one follows its parent)
    int count = 0;  ///< leaf: number of entries; else 0
  };
  std::vector<Node> nodes_;
  std::vector<int> leaves_;           ///< indices of boxes in tree order
  std::vector<Box<Dim>> leaf_boxes_;  ///< in tree order
};

extern template class Bvh<2>;
extern template class Bvh<3>;

}  // namespace itr
