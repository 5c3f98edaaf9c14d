// SPDX-License-Identifier: MIT
#include "geometry/dynamic_tree.hpp"

#include <algorithm>

namespace itr {

namespace {

/// Half the surface of a box (2D: half its circumference): what makes a query meet it.
template <int Dim>
double extent(const Box<Dim>& box) {
  const Vec<Dim> size = box.max - box.min;
  if constexpr (Dim == 2) return size.sum();
  if constexpr (Dim == 3) return size[0] * size[1] + size[1] * size[2] + size[2] * size[0];
}

template <int Dim>
Box<Dim> united(Box<Dim> a, const Box<Dim>& b) {
  a.include(b);
  return a;
}

template <int Dim>
bool is_empty(const Box<Dim>& box) {
  return !(box.min[0] <= box.max[0]);
}

}  // namespace

template <int Dim>
void DynamicTree<Dim>::build(std::span<const Box<Dim>> boxes) {
  nodes_.clear();
  free_.clear();
  leaf_of_.assign(boxes.size(), kNone);
  std::vector<int> items;
  for (std::size_t i = 0; i < boxes.size(); ++i)
    if (!is_empty(boxes[i])) items.push_back(static_cast<int>(i));
  root_ = items.empty() ? kNone : build_node(boxes, items, kNone);
}

template <int Dim>
int DynamicTree<Dim>::new_node() {
  if (!free_.empty()) {
    const int node = free_.back();
    free_.pop_back();
    nodes_[node] = {};
    return node;
  }
  nodes_.emplace_back();
  return static_cast<int>(nodes_.size()) - 1;
}

template <int Dim>
int DynamicTree<Dim>::build_node(std::span<const Box<Dim>> boxes, std::span<int> items, int parent) {
  const int node = new_node();
  nodes_[node].parent = parent;
  Box<Dim> box, centers;
  for (const int i : items) {
    box.include(boxes[i]);
    centers.include(Vec<Dim>(boxes[i].min + boxes[i].max));
  }
  nodes_[node].box = box;
  if (items.size() == 1) {
    nodes_[node].item = items[0];
    leaf_of_[items[0]] = node;
    return node;
  }
  Eigen::Index axis = 0;
  (centers.max - centers.min).maxCoeff(&axis);
  const std::size_t middle = items.size() / 2;
  std::nth_element(items.begin(), items.begin() + static_cast<std::ptrdiff_t>(middle), items.end(), [&](int a, int b) {
    const double ca = boxes[a].min[axis] + boxes[a].max[axis], cb = boxes[b].min[axis] + boxes[b].max[axis];
    return ca != cb ? ca < cb : a < b;
  });
  const int left = build_node(boxes, items.first(middle), node);
  const int right = build_node(boxes, items.subspan(middle), node);
  nodes_[node].left = left;
  nodes_[node].right = right;
  return node;
}

/// As far up as boxes change.
template <int Dim>
void DynamicTree<Dim>::refit_from(int node) {
  for (; node != kNone; node = nodes_[node].parent) {
    const Box<Dim> box = united(nodes_[nodes_[node].left].box, nodes_[nodes_[node].right].box);
    if (box.min == nodes_[node].box.min && box.max == nodes_[node].box.max) return;
    nodes_[node].box = box;
  }
}

/// Gives a leaf the sibling that makes the boxes on the way grow least, found greedily from the root.
template <int Dim>
void DynamicTree<Dim>::attach(int leaf) {
  if (root_ == kNone) {
    root_ = leaf;
    nodes_[leaf].parent = kNone;
    return;
  }
  const Box<Dim> box = nodes_[leaf].box;
  int sibling = root_;
  while (nodes_[sibling].left != kNone) {
    const auto growth = [&](int child) { return extent(united(nodes_[child].box, box)) - extent(nodes_[child].box); };
    const int left = nodes_[sibling].left, right = nodes_[sibling].right;
    sibling = growth(left) <= growth(right) ? left : right;
  }
  const int above = nodes_[sibling].parent, joint = new_node();
  nodes_[joint].parent = above;
  nodes_[joint].left = sibling;
  nodes_[joint].right = leaf;
  nodes_[sibling].parent = nodes_[leaf].parent = joint;
  if (above == kNone)
    root_ = joint;
  else
    (nodes_[above].left == sibling ? nodes_[above].left : nodes_[above].right) = joint;
  refit_from(joint);
}

template <int Dim>
void DynamicTree<Dim>::detach(int leaf) {
  const int joint = nodes_[leaf].parent;
  if (joint == kNone) {
    root_ = kNone;
    return;
  }
  const int sibling = nodes_[joint].left == leaf ? nodes_[joint].right : nodes_[joint].left;
  const int above = nodes_[joint].parent;
  nodes_[sibling].parent = above;
  free_.push_back(joint);
  if (above == kNone) {
    root_ = sibling;
    return;
  }
  (nodes_[above].left == joint ? nodes_[above].left : nodes_[above].right) = sibling;
  refit_from(above);
}

template <int Dim>
void DynamicTree<Dim>::insert(int item, const Box<Dim>& box) {
  if (item >= static_cast<int>(leaf_of_.size())) leaf_of_.resize(item + 1, kNone);
  const int leaf = new_node();
  nodes_[leaf].item = item;
  nodes_[leaf].box = box;
  leaf_of_[item] = leaf;
  attach(leaf);
}

template <int Dim>
void DynamicTree<Dim>::remove(int item) {
  const int leaf = leaf_of_[item];
  detach(leaf);
  free_.push_back(leaf);
  leaf_of_[item] = kNone;
}

template <int Dim>
void DynamicTree<Dim>::update(int item, const Box<Dim>& box) {
  const int leaf = leaf_of_[item], parent = nodes_[leaf].parent;
  nodes_[leaf].box = box;
  if (parent == kNone) return;
  // Small motions leave the leaf where it is; what has left its surroundings gets a new place.
  const Box<Dim>& around = nodes_[parent].box;
  if (around.overlaps(box)) return refit_from(parent);
  detach(leaf);
  attach(leaf);
}

template <int Dim>
void DynamicTree<Dim>::query(const Box<Dim>& box, std::vector<int>& hits) const {
  const auto visit = [&](auto&& self, int index) -> void {
    const Node& node = nodes_[index];
    if (!node.box.overlaps(box)) return;
    if (node.left == kNone) {
      hits.push_back(node.item);
      return;
    }
    self(self, node.left);
    self(self, node.right);
  };
  if (root_ != kNone) visit(visit, root_);
}

template class DynamicTree<2>;
template class DynamicTree<3>;

}  // namespace itr
