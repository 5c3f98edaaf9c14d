// SPDX-License-Identifier: MIT
// Numeric phase of a multifrontal Cholesky factorisation, with its solves, by tasks over the tree of fronts.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "assembly_tree.hpp"
#include "dense_kernels.hpp"
#include "task_graph.hpp"

namespace itr::backends {

/// Doubles at the start of a cache line, not initialised. Large ones are on large pages where the system has them.
class Doubles {
 public:
  Doubles() = default;
  explicit Doubles(std::size_t size);
  double* data() const { return data_.get(); }
  std::size_t size() const { return size_; }

 private:
  struct Free {
    void operator()(double* data) const { std::free(data); }
  };
  std::unique_ptr<double, Free> data_;
  std::size_t size_ = 0;
};

/// Objects that tasks borrow, each by one task at a time.
template <typename Object>
class Pool {
 public:
  /// The free one of least `excess` that is not negative, else one that `make` makes.
  template <typename Excess, typename Make>
  Object take(const Excess& excess, const Make& make) {
    {
      const std::scoped_lock guard(lock_);
      auto best = free_.end();
      for (auto it = free_.begin(); it != free_.end(); ++it)
        if (excess(*it) >= 0 && (best == free_.end() || excess(*it) < excess(*best))) best = it;
      if (best != free_.end()) {
        std::swap(*best, free_.back());
        Object taken = std::move(free_.back());
        free_.pop_back();
        return taken;
      }
    }
    return make();
  }
  void give_back(Object object) {
    const std::scoped_lock guard(lock_);
    free_.push_back(std::move(object));
  }
  void clear() { free_.clear(); }
  const std::vector<Object>& free() const { return free_; }

 private:
  std::mutex lock_;
  std::vector<Object> free_;
};

/// A matrix is cut into pieces and tiles by its pattern alone, and each sum is taken in one order. So factor and solutions
/// have the same bits for any number of threads.
class TaskCholesky {
 public:
  /// False where the pattern is in no postorder.
  bool analyze(const SupernodalPattern& pattern);
  /// Entry k of the pattern has the value values[sources[k]]. Returns the number of columns before the first pivot that is
  /// not positive; the order: all.
  int factorize(const double* values, std::span<const int> sources);
  /// Solves for columns of length `order` one after another, where unknown k of the factor is permutation[k] of theirs.
  void solve(const double* rhs, double* solution, int columns, const int* permutation);
  int order() const { return tree_.order; }
  std::size_t factor_size() const { return tree_.panels.empty() ? 0 : tree_.panels.back(); }
  /// Doubles beside the factor that the last factorisation has used.
  std::size_t work_size() const;

  /// Seconds of the last factorisation or solve.
  const TaskTimes& times() const { return times_; }

 private:
  enum class Kind : char { piece, front, open, panel, tile, block, close, gather, rows, columns, pivots };
  struct Task {
    Kind kind;
    int front;  ///< or piece
    int i = 0, j = 0;
  };
  struct Graph {
    TaskGraph graph;
    std::vector<Task> tasks;
    int add(const Task& task, double cost) {
      tasks.push_back(task);
      return graph.add(cost);
    }
    void clear() {
      graph.clear();
      tasks.clear();
    }
  };
  struct Range {
    int begin, end;
    int size() const { return end - begin; }
  };
  /// Contributions of a piece's fronts, those at even and at odd depths: in postorder each stack ends with what goes next.
  struct Stacks {
    Doubles values[2];
  };
  struct Scratch {
    std::vector<double> front;  ///< of one front's height
    std::vector<double> above;  ///< of all unknowns, zero but while a piece adds up what it hands on
  };
  class Solve;

  void plan_stacks();
  void plan_factorization();
  void plan_tiles(int front, std::vector<int>& done);
  void plan_solves();
  void plan_forward();
  void plan_backward();

  double* panel(int front) const { return factor_.data() + tree_.panels[front]; }
  int num_panels(int front) const;
  Range panel_columns(int front, int panel) const;
  Range tile_rows(int front, int tile) const;
  double* column(int front, int j) const;
  bool is_tiled(int front) const;

  void run(const Task& task);
  void factorize_piece(const Piece& piece);
  void factorize_front(int front);
  void factorize_tile(int front, int tile, int panel);
  void factorize_block(int front, int row_block, int column_block);
  void clear_panel(int front, Range columns);
  void add_children(int front, Range rows, Range columns);
  void fail(int column);
  bool has_failed(int front) const { return failed_.load(std::memory_order_relaxed) < tree_.first_columns[front]; }
  void open(int front);
  void release(int front);
  void release_children(int front);

  const DenseKernels& dense_ = dense_kernels();
  AssemblyTree tree_;
  TreeCut cut_;
  std::vector<char> parity_;             ///< of a front's depth in its piece
  std::size_t stack_sizes_[2] = {0, 0};  ///< that any piece needs
  Graph factor_graph_, forward_graph_, backward_graph_;
  bool is_short_ = true, solves_are_short_ = true;  ///< too short for several threads
  std::vector<std::size_t> updates_;  ///< where the update of a solution by a piece's root or a front above begins

  Doubles factor_;
  std::vector<Contribution> contributions_;
  std::vector<Doubles> blocks_;  ///< of the contributions that are in no stack
  Pool<Doubles> pool_;
  Pool<Stacks> stacks_;
  Pool<std::unique_ptr<Scratch>> scratch_;
  std::vector<double> permuted_, update_values_;
  std::atomic<int> failed_{0};  ///< least column so far with a pivot that is not positive
  const double* values_ = nullptr;
  std::span<const int> sources_;
  TaskTimes times_;
};

}  // namespace itr::backends
