// SPDX-License-Identifier: MIT
// A static tree of axis-aligned boxes.
#pragma once

#include <array>
#include <limits>
#include <span>
#include <vector>

#include "itr/types.hpp"

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
/// boxes only. Nodes hold the boxes of eight children, in single precision and rounded outward, so that one instruction
/// compares them all (Wald et al. 2008, "Getting rid of packets").
template <int Dim>
class Bvh {
 public:
  Bvh() = default;
  explicit Bvh(std::span<const Box<Dim>> boxes) { build(boxes); }
  void build(std::span<const Box<Dim>> boxes);
  /// Same number and order of boxes, new extents: keeps the tree, updates it in linear time.
  void refit(std::span<const Box<Dim>> boxes);
  int size() const { return static_cast<int>(boxes_.size()); }
  /// Appends to `hits` the indices of all boxes that overlap `box`.
  void query(const Box<Dim>& box, std::vector<int>& hits) const;

 private:
  static constexpr int kWidth = 8;
  using Lanes __attribute__((vector_size(kWidth * sizeof(float)))) = float;  // of GCC and Clang
  struct Node {
    std::array<Lanes, Dim> min, max;
    std::array<int, kWidth> child;  ///< >= 0: a node; else -1 - (index of a box)
    int count = 0;                  ///< of children
  };
  void set_boxes();

  std::vector<Node> nodes_;  ///< children come after their parents
  std::vector<Box<Dim>> boxes_;
};

extern template class Bvh<2>;
extern template class Bvh<3>;

}  // namespace itr
