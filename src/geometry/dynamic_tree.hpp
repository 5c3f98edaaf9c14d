// SPDX-License-Identifier: MIT
// A tree of axis-aligned boxes that come, go and change, each in logarithmic time.
#pragma once

#include <span>
#include <vector>

#include "geometry/bvh.hpp"

namespace itr {

/// Items are small non-negative numbers, each with one closed box. Queries do not change the tree: several may run at once.
template <int Dim>
class DynamicTree {
 public:
  /// Items 0 to n - 1; an empty box (min > max) stands for an item that is not there.
  void build(std::span<const Box<Dim>> boxes);
  bool holds(int item) const { return item < static_cast<int>(leaf_of_.size()) && leaf_of_[item] != kNone; }
  /// Box of an item that is in the tree.
  const Box<Dim>& box(int item) const { return nodes_[leaf_of_[item]].box; }
  void insert(int item, const Box<Dim>& box);
  void remove(int item);
  /// A new box of an item that is there.
  void update(int item, const Box<Dim>& box);
  /// Appends the items whose boxes overlap `box`, in an order that depends on the tree's history.
  void query(const Box<Dim>& box, std::vector<int>& hits) const;

 private:
  struct Node {
    Box<Dim> box;
    int parent = kNone;
    int left = kNone, right = kNone;  ///< kNone in leaves
    int item = kNone;                 ///< of a leaf
  };
  int new_node();
  int build_node(std::span<const Box<Dim>> boxes, std::span<int> items, int parent);
  void refit_from(int node);
  void attach(int leaf);
  void detach(int leaf);

  std::vector<Node> nodes_;
  std::vector<int> free_;
  std::vector<int> leaf_of_;  ///< by item
  int root_ = kNone;
};

extern template class DynamicTree<2>;
extern template class DynamicTree<3>;

}  // namespace itr
