// SPDX-License-Identifier: MIT
// Solves with a factor: forward from the leaves of the tree to its roots, then backward.
#include <algorithm>

#include "dense_kernels.hpp"
#include "task_cholesky.hpp"

namespace itr::backends {

namespace {

constexpr int kRows = 2048;                  ///< of a task of a forward solve
constexpr int kColumns = 64;                 ///< of a task of a backward solve
constexpr std::size_t kTiledFrom = 1 << 16;  ///< entries of a panel
constexpr std::size_t kLong = 1 << 18;       ///< entries of a factor whose solve several threads share

struct Part {
  int begin, end;
};

/// Part of `size` rows or columns of a front that one task takes: `width` of them, or all where the front is small.
Part part_of(const AssemblyTree& tree, int front, int size, int width, int part) {
  if (tree.panel_size(front) < kTiledFrom) return {0, size};
  return {part * width, std::min(size, (part + 1) * width)};
}
int num_parts(const AssemblyTree& tree, int front, int size, int width) {
  return tree.panel_size(front) < kTiledFrom ? 1 : std::max(1, (size + width - 1) / width);
}

}  // namespace

/// One solve with all its columns. Solution and updates are stored column after column.
class TaskCholesky::Solve {
 public:
  Solve(TaskCholesky& of, int columns) : all_(of), tree_(of.tree_), columns_(columns), stride_(of.updates_.back()) {}
  void run(const Task& task, bool forward);

 private:
  double* solution(int column, int unknown) const {
    return all_.permuted_.data() + static_cast<std::size_t>(column) * tree_.order + unknown;
  }
  double* update(int column, int front) const {
    return all_.update_values_.data() + column * stride_ + all_.updates_[front];
  }
  void piece_forward(const Piece& piece);
  void piece_backward(const Piece& piece);
  void gather_children(int front);
  void gather_above(int front);
  void pivots(int front, bool forward);
  void rows(int front, int part);
  void columns(int front, int part);
  std::unique_ptr<Scratch> take_scratch();

  TaskCholesky& all_;
  const AssemblyTree& tree_;
  int columns_;
  std::size_t stride_;
};

void TaskCholesky::plan_solves() {
  updates_.assign(tree_.size + 1, 0);
  for (int s = 0; s < tree_.size; ++s)
    updates_[s + 1] = updates_[s] + (cut_.is_above[s] || cut_.is_root(tree_, s) ? tree_.below(s) : 0);
  solves_are_short_ = factor_size() < kLong;
  plan_forward();
  plan_backward();
}

void TaskCholesky::plan_forward() {
  forward_graph_.clear();
  std::vector<std::vector<int>> done(tree_.size);  // tasks after which a root's or a front's update is there
  for (std::size_t p = 0; p < cut_.pieces.size(); ++p) {
    const auto [begin, end] = cut_.pieces[p];
    const int task = forward_graph_.add({Kind::piece, static_cast<int>(p)}, double(tree_.panels[end] - tree_.panels[begin]));
    for (int s = begin; s < end; ++s) done[s] = {task};
  }
  for (int s = 0; s < tree_.size; ++s) {
    if (!cut_.is_above[s]) continue;
    const int pivots = forward_graph_.add({Kind::pivots, s}, double(tree_.panel_size(s)) / 2);
    for (const int child : tree_.children_of(s))
      for (const int task : done[child]) forward_graph_.graph.wait_for(pivots, task);
    for (int part = 0; part < num_parts(tree_, s, tree_.below(s), kRows); ++part) {
      done[s].push_back(forward_graph_.add({Kind::rows, s, part}, double(kRows) * tree_.columns(s)));
      forward_graph_.graph.wait_for(done[s].back(), pivots);
    }
  }
  forward_graph_.graph.finish();
}

void TaskCholesky::plan_backward() {
  backward_graph_.clear();
  std::vector<int> solved(tree_.size, -1);
  const auto wait_for_parent = [&](int task, int s) {
    if (tree_.parent[s] >= 0) backward_graph_.graph.wait_for(task, solved[tree_.parent[s]]);
  };
  for (int s = tree_.size - 1; s >= 0; --s) {
    if (!cut_.is_above[s]) continue;
    const int gather = backward_graph_.add({Kind::gather, s}, tree_.below(s));
    wait_for_parent(gather, s);
    std::vector<int> before;
    for (int part = 0; part < num_parts(tree_, s, tree_.columns(s), kColumns); ++part) {
      before.push_back(backward_graph_.add({Kind::columns, s, part}, double(kColumns) * tree_.below(s)));
      backward_graph_.graph.wait_for(before.back(), gather);
    }
    solved[s] = backward_graph_.add({Kind::pivots, s}, double(tree_.panel_size(s)) / 2);
    for (const int task : before) backward_graph_.graph.wait_for(solved[s], task);
  }
  for (std::size_t p = cut_.pieces.size(); p-- > 0;) {
    const auto [begin, end] = cut_.pieces[p];
    const int task =
        backward_graph_.add({Kind::piece, static_cast<int>(p)}, double(tree_.panels[end] - tree_.panels[begin]));
    for (int s = begin; s < end; ++s)
      if (cut_.is_root(tree_, s)) wait_for_parent(task, s);
  }
  backward_graph_.graph.finish();
}

void TaskCholesky::solve(const double* rhs, double* solution, int columns, const int* permutation) {
  const std::size_t n = tree_.order;
  permuted_.resize(n * columns);
  update_values_.resize(updates_.back() * columns);
  for (int c = 0; c < columns; ++c)
    for (std::size_t i = 0; i < n; ++i) permuted_[c * n + i] = rhs[c * n + permutation[i]];
  Solve now(*this, columns);
  times_ = {};
  for (const bool forward : {true, false}) {
    Graph& graph = forward ? forward_graph_ : backward_graph_;
    const auto work = [&](int task) { now.run(graph.tasks[task], forward); };
    graph.graph.run(work, solves_are_short_);
    const TaskTimes& times = graph.graph.times();
    times_ = {times_.wall + times.wall, times_.work + times.work, times_.span + times.span};
  }
  for (int c = 0; c < columns; ++c)
    for (std::size_t i = 0; i < n; ++i) solution[c * n + permutation[i]] = permuted_[c * n + i];
}

void TaskCholesky::Solve::run(const Task& task, bool forward) {
  switch (task.kind) {
    case Kind::piece:
      return forward ? piece_forward(all_.cut_.pieces[task.front]) : piece_backward(all_.cut_.pieces[task.front]);
    case Kind::gather:
      return gather_above(task.front);
    case Kind::rows:
      return rows(task.front, task.i);
    case Kind::columns:
      return columns(task.front, task.i);
    default:
      if (forward) gather_children(task.front);
      return pivots(task.front, forward);
  }
}

std::unique_ptr<TaskCholesky::Scratch> TaskCholesky::Solve::take_scratch() {
  auto scratch = all_.scratch_.take([](const auto&) { return 0; }, [] { return std::make_unique<Scratch>(); });
  if (const std::size_t size = static_cast<std::size_t>(tree_.order) * columns_; scratch->above.size() < size)
    scratch->above.resize(size, 0.0);
  if (scratch->front.size() < static_cast<std::size_t>(tree_.order)) scratch->front.resize(tree_.order);
  return scratch;
}

void TaskCholesky::Solve::piece_forward(const Piece& piece) {
  auto scratch = take_scratch();
  double* const v = scratch->front.data();
  const int end = tree_.first_columns[piece.end];
  for (int s = piece.begin; s < piece.end; ++s) {
    const int k = tree_.columns(s), r = tree_.height(s);
    const auto rows = tree_.rows_below(s);
    const bool is_root = all_.cut_.is_root(tree_, s);
    for (int c = 0; c < columns_; ++c) {
      double* const x = solution(c, 0);
      double* const above = scratch->above.data() + static_cast<std::size_t>(c) * tree_.order;
      std::copy_n(x + tree_.first_columns[s], k, v);
      std::fill_n(v + k, r - k, 0.0);
      all_.dense_.solve_forward(all_.panel(s), r, v, r, k);
      std::copy_n(v, k, x + tree_.first_columns[s]);
      for (int i = 0; i < r - k; ++i) (rows[i] < end ? x : above)[rows[i]] += v[k + i];
      if (!is_root) continue;
      double* const handed = update(c, s);
      for (int i = 0; i < r - k; ++i) handed[i] = std::exchange(above[rows[i]], 0.0);
    }
  }
  all_.scratch_.give_back(std::move(scratch));
}

void TaskCholesky::Solve::piece_backward(const Piece& piece) {
  auto scratch = take_scratch();
  double* const v = scratch->front.data();
  for (int s = piece.end - 1; s >= piece.begin; --s) {
    const int k = tree_.columns(s), r = tree_.height(s);
    const auto rows = tree_.rows_below(s);
    for (int c = 0; c < columns_; ++c) {
      double* const x = solution(c, 0);
      std::copy_n(x + tree_.first_columns[s], k, v);
      for (int i = 0; i < r - k; ++i) v[k + i] = x[rows[i]];
      all_.dense_.solve_backward(all_.panel(s), r, v, r, k);
      std::copy_n(v, k, x + tree_.first_columns[s]);
    }
  }
  all_.scratch_.give_back(std::move(scratch));
}

void TaskCholesky::Solve::gather_children(int s) {
  const int k = tree_.columns(s);
  for (int c = 0; c < columns_; ++c) {
    double* const own = solution(c, tree_.first_columns[s]);
    double* const handed = update(c, s);
    std::fill_n(handed, tree_.below(s), 0.0);
    for (const int child : tree_.children_of(s)) {
      const auto places = tree_.relative_below(child);
      const double* const from = update(c, child);
      for (std::size_t i = 0; i < places.size(); ++i) (places[i] < k ? own : handed - k)[places[i]] += from[i];
    }
  }
}

void TaskCholesky::Solve::gather_above(int s) {
  const auto rows = tree_.rows_below(s);
  for (int c = 0; c < columns_; ++c) {
    const double* const x = solution(c, 0);
    double* const gathered = update(c, s);
    for (std::size_t i = 0; i < rows.size(); ++i) gathered[i] = x[rows[i]];
  }
}

void TaskCholesky::Solve::pivots(int s, bool forward) {
  const int k = tree_.columns(s);
  for (int c = 0; c < columns_; ++c)
    (forward ? all_.dense_.solve_forward : all_.dense_.solve_backward)(all_.panel(s), tree_.height(s),
                                                                       solution(c, tree_.first_columns[s]), k, k);
}

void TaskCholesky::Solve::rows(int s, int part) {
  const int k = tree_.columns(s), r = tree_.height(s);
  const auto [begin, end] = part_of(tree_, s, r - k, kRows, part);
  for (int c = 0; c < columns_; ++c)
    all_.dense_.subtract_multiple(all_.panel(s) + k + begin, r, solution(c, tree_.first_columns[s]), update(c, s) + begin,
                                  end - begin, k);
}

void TaskCholesky::Solve::columns(int s, int part) {
  const int k = tree_.columns(s), r = tree_.height(s);
  const auto [begin, end] = part_of(tree_, s, k, kColumns, part);
  for (int c = 0; c < columns_; ++c)
    all_.dense_.subtract_transposed(all_.panel(s) + k + static_cast<std::size_t>(begin) * r, r, update(c, s),
                                    solution(c, tree_.first_columns[s] + begin), r - k, end - begin);
}

}  // namespace itr::backends
