// SPDX-License-Identifier: MIT
// Supernodes of a Cholesky factor as a tree of fronts, and its cut into pieces of work.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace itr::backends {

/// Supernodal analysis of a matrix in the order of its factor, with the matrix's own entries.
struct SupernodalPattern {
  std::span<const int> first_columns;  ///< of each supernode, then the order
  std::span<const int> row_starts;     ///< of each supernode in `rows`, then their number
  std::span<const int> rows;           ///< of each supernode, ascending, its own columns first
  std::span<const int> column_starts;  ///< lower triangle of the matrix: order + 1
  std::span<const int> row_indices;
};

/// A front is a supernode's columns (its panel) with the update that they hand to the fronts above, its contribution: the
/// lower triangle of a matrix of all rows below the columns. The fronts come in postorder.
struct AssemblyTree {
  int order = 0, size = 0;
  std::vector<int> first_columns, row_starts;  ///< as above
  std::vector<int> rows;
  std::vector<std::size_t> panels;          ///< where a front's panel begins in the factor; size + 1
  std::vector<int> parent;                  ///< of a front; -1: none
  std::vector<int> children, child_starts;  ///< ascending
  std::vector<int> relative;                ///< of `rows` below the columns: place among the rows of the parent
  std::vector<int> entry_starts;            ///< of each column of the matrix; order + 1
  std::vector<std::size_t> entries;         ///< place in the factor of each entry of the matrix

  /// False where the supernodes are in no postorder.
  bool assign(const SupernodalPattern& pattern);

  int columns(int front) const { return first_columns[front + 1] - first_columns[front]; }
  int height(int front) const { return row_starts[front + 1] - row_starts[front]; }
  int below(int front) const { return height(front) - columns(front); }
  std::size_t panel_size(int front) const { return panels[front + 1] - panels[front]; }
  std::span<const int> rows_below(int front) const { return span_below(rows, front); }
  std::span<const int> relative_below(int front) const { return span_below(relative, front); }
  std::span<const int> children_of(int front) const {
    return {children.data() + child_starts[front], children.data() + child_starts[front + 1]};
  }
  /// Cost of a front, in flops: those of the panel and the contribution, and what moving its entries takes.
  double cost(int front) const;

 private:
  std::span<const int> span_below(const std::vector<int>& of, int front) const {
    return {of.data() + row_starts[front] + columns(front), of.data() + row_starts[front + 1]};
  }
  bool assign_parents();
  void assign_relative();
  void assign_entries(const SupernodalPattern& pattern);
};

/// Contributions are stored by blocks of columns, without what is above a block: half of the square.
struct Contribution {
  static constexpr int kBlock = 128;
  double* values = nullptr;
  int order = 0;

  static std::size_t size(int order) {
    const std::size_t blocks = order / kBlock, rest = order - blocks * kBlock;
    return begin(order, blocks) + rest * rest;
  }
  int num_blocks() const { return (order + kBlock - 1) / kBlock; }
  int first(int block) const { return block * kBlock; }
  int last(int block) const { return block == num_blocks() - 1 ? order : first(block + 1); }
  int stride(int block) const { return order - first(block); }
  /// The entry (first(block), first(block)).
  double* block(int block) const { return values + begin(order, block); }
  /// Start of a column by rows from 0, of which only those of its block and below are there.
  double* column(int j) const {
    const int b = j / kBlock;
    return block(b) + static_cast<std::size_t>(j - first(b)) * stride(b) - first(b);
  }

 private:
  static std::size_t begin(std::size_t order, std::size_t block) {
    return block * kBlock * order - kBlock * kBlock * (block * (block - 1) / 2);
  }
};

/// Consecutive fronts with all that is below them, which one task does one after the other.
struct Piece {
  int begin = 0, end = 0;
};

/// Cut of the tree, by costs alone: pieces and, above them, fronts by themselves (`is_above`).
struct TreeCut {
  std::vector<Piece> pieces;  ///< ascending
  std::vector<char> is_above;
  /// No piece costs more than `most`.
  TreeCut(const AssemblyTree& tree, double most);
  /// Whether a front hands its contribution to another task.
  bool is_root(const AssemblyTree& tree, int front) const {
    return !is_above[front] && (tree.parent[front] < 0 || is_above[tree.parent[front]]);
  }
  TreeCut() = default;
};

}  // namespace itr::backends
