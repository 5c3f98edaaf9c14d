// SPDX-License-Identifier: MIT
#include "task_cholesky.hpp"

#include <sys/mman.h>

#include <algorithm>
#include <new>
#include <utility>

namespace itr::backends {

namespace {

// The cut of the work, in the costs of AssemblyTree.
constexpr double kPieces = 96;       ///< about so many, where they are large enough
constexpr double kLeastPiece = 4e6;  ///< a tenth of a millisecond
constexpr double kLong = 2e7;        ///< cost of a factorisation from which several threads share it
constexpr double kTiledFrom = 1e7;   ///< cost of a front that is cut into tiles
constexpr int kPanel = 64;           ///< columns of a tile

constexpr std::size_t round_up(std::size_t size) { return (size + 7) / 8 * 8; }

}  // namespace

Doubles::Doubles(std::size_t size) : size_(size) {
  constexpr std::size_t kLine = 64, kLargePage = std::size_t{1} << 21;
  const std::size_t bytes = std::max<std::size_t>(size, 1) * sizeof(double);
  const std::size_t alignment = bytes >= 2 * kLargePage ? kLargePage : kLine;
  const std::size_t whole = (bytes + alignment - 1) / alignment * alignment;
  data_.reset(static_cast<double*>(std::aligned_alloc(alignment, whole)));
  if (!data_) throw std::bad_alloc();
  if (alignment == kLargePage) madvise(data_.get(), whole, MADV_HUGEPAGE);
}

// --- The plan ---

bool TaskCholesky::analyze(const SupernodalPattern& pattern) {
  if (!tree_.assign(pattern)) return false;
  double total = 0;
  for (int s = 0; s < tree_.size; ++s) total += tree_.cost(s);
  is_short_ = total < kLong;
  cut_ = TreeCut(tree_, std::max(kLeastPiece, total / kPieces));
  if (factor_.size() < factor_size() || factor_.size() > 2 * factor_size()) {
    factor_ = {};
    pool_.clear();
    stacks_.clear();
  }
  contributions_.assign(tree_.size, {});
  for (int s = 0; s < tree_.size; ++s) contributions_[s].order = tree_.below(s);
  blocks_.clear();
  blocks_.resize(tree_.size);
  plan_stacks();
  plan_factorization();
  plan_solves();
  return true;
}

void TaskCholesky::plan_stacks() {
  parity_.assign(tree_.size, 0);
  for (int s = tree_.size - 1; s >= 0; --s)
    if (!cut_.is_above[s] && !cut_.is_root(tree_, s)) parity_[s] = !parity_[tree_.parent[s]];
  stack_sizes_[0] = stack_sizes_[1] = 0;
  for (const Piece& piece : cut_.pieces) {
    std::size_t top[2] = {0, 0};
    for (int s = piece.begin; s < piece.end; ++s) {
      if (!cut_.is_root(tree_, s)) {
        top[int(parity_[s])] += round_up(Contribution::size(tree_.below(s)));
        stack_sizes_[int(parity_[s])] = std::max(stack_sizes_[int(parity_[s])], top[int(parity_[s])]);
      }
      for (const int child : tree_.children_of(s))
        top[int(parity_[child])] -= round_up(Contribution::size(tree_.below(child)));
    }
  }
}

void TaskCholesky::plan_factorization() {
  factor_graph_.clear();
  std::vector<int> done(tree_.size, -1);  // the task after which a root's or a front's contribution is there
  auto piece = cut_.pieces.begin();
  for (int s = 0; s < tree_.size; ++s) {
    if (piece != cut_.pieces.end() && s == piece->begin) {
      double cost = 0;
      for (int t = piece->begin; t < piece->end; ++t) cost += tree_.cost(t);
      const int task = factor_graph_.add({Kind::piece, static_cast<int>(piece - cut_.pieces.begin())}, cost);
      std::fill(done.begin() + piece->begin, done.begin() + piece->end, task);
      ++piece;
    }
    if (!cut_.is_above[s]) continue;
    if (is_tiled(s)) {
      plan_tiles(s, done);
      continue;
    }
    done[s] = factor_graph_.add({Kind::front, s}, tree_.cost(s));
    for (const int child : tree_.children_of(s)) factor_graph_.graph.wait_for(done[s], done[child]);
  }
  factor_graph_.graph.finish();
}

void TaskCholesky::plan_tiles(int s, std::vector<int>& done) {
  TaskGraph& graph = factor_graph_.graph;
  const int panels = num_panels(s), blocks = contributions_[s].num_blocks();
  const int open = factor_graph_.add({Kind::open, s}, 1e4);
  for (const int child : tree_.children_of(s)) graph.wait_for(open, done[child]);
  std::vector<int> last(panels + blocks, open);  // the last task of each tile of rows
  for (int p = 0; p < panels; ++p) {
    const double width = panel_columns(s, p).size(), depth = panel_columns(s, p).begin;
    const int clear = factor_graph_.add({Kind::panel, s, 0, p}, 20 * width * tree_.height(s));
    graph.wait_for(clear, open);
    for (int t = p; t < panels + blocks; ++t) {
      const int task = factor_graph_.add({Kind::tile, s, t, p}, width * tile_rows(s, t).size() * (2 * depth + width + 40));
      graph.wait_for(task, clear);
      graph.wait_for(task, last[t]);
      if (t > p) graph.wait_for(task, last[p]);
      last[t] = task;
    }
  }
  std::vector<int> parts;
  for (int q = 0; q < blocks; ++q)
    for (int i = q; i < blocks; ++i) {
      const double entries = double(tile_rows(s, panels + i).size()) * tile_rows(s, panels + q).size();
      parts.push_back(factor_graph_.add({Kind::block, s, i, q}, entries * (2.0 * tree_.columns(s) + 40) / (1 + (i == q))));
      graph.wait_for(parts.back(), last[panels + i]);
      if (i != q) graph.wait_for(parts.back(), last[panels + q]);
    }
  if (blocks == 0) parts.push_back(last[panels - 1]);
  done[s] = factor_graph_.add({Kind::close, s}, 1e4);
  for (const int part : parts) graph.wait_for(done[s], part);
}

int TaskCholesky::num_panels(int s) const { return (tree_.columns(s) + kPanel - 1) / kPanel; }

TaskCholesky::Range TaskCholesky::panel_columns(int s, int panel) const {
  return {panel * kPanel, std::min((panel + 1) * kPanel, tree_.columns(s))};
}

/// Rows of a tile: as many as its panel has columns beside the panel, a block of the contribution below.
TaskCholesky::Range TaskCholesky::tile_rows(int s, int tile) const {
  const int panels = num_panels(s), k = tree_.columns(s);
  if (tile < panels) return panel_columns(s, tile);
  return {k + contributions_[s].first(tile - panels), k + contributions_[s].last(tile - panels)};
}

bool TaskCholesky::is_tiled(int s) const { return tree_.cost(s) > kTiledFrom; }

// --- Factorisation ---

int TaskCholesky::factorize(const double* values, std::span<const int> sources) {
  if (factor_.size() < factor_size()) factor_ = Doubles(factor_size());
  values_ = values;
  sources_ = sources;
  failed_ = tree_.order;
  const auto release_all = [&] {
    for (int s = 0; s < tree_.size; ++s) release(s);
  };
  try {
    factor_graph_.graph.run([&](int task) { run(factor_graph_.tasks[task]); }, is_short_);
  } catch (...) {
    release_all();
    throw;
  }
  release_all();
  times_ = factor_graph_.graph.times();
  return failed_;
}

void TaskCholesky::run(const Task& task) {
  const int s = task.front;
  if (task.kind == Kind::piece) return factorize_piece(cut_.pieces[s]);
  if (has_failed(s)) return;
  switch (task.kind) {
    case Kind::front:
      open(s);
      factorize_front(s);
      return release_children(s);
    case Kind::open:
      return open(s);
    case Kind::panel:
      return clear_panel(s, panel_columns(s, task.j));
    case Kind::tile:
      return factorize_tile(s, task.i, task.j);
    case Kind::block:
      return factorize_block(s, task.i, task.j);
    default:
      return release_children(s);
  }
}

void TaskCholesky::factorize_piece(const Piece& piece) {
  const auto fits = [&](const Stacks& free) {
    return free.values[0].size() >= stack_sizes_[0] && free.values[1].size() >= stack_sizes_[1] ? 0 : -1;
  };
  Stacks stacks = stacks_.take(fits, [&] { return Stacks{{Doubles(stack_sizes_[0]), Doubles(stack_sizes_[1])}}; });
  std::size_t top[2] = {0, 0};
  for (int s = piece.begin; s < piece.end && !has_failed(s); ++s) {
    const int parity = parity_[s];
    if (cut_.is_root(tree_, s)) {
      open(s);
    } else {
      contributions_[s].values = stacks.values[parity].data() + top[parity];
      top[parity] += round_up(Contribution::size(tree_.below(s)));
    }
    factorize_front(s);
    for (const int child : tree_.children_of(s)) {
      contributions_[child].values = nullptr;
      top[int(parity_[child])] -= round_up(Contribution::size(tree_.below(child)));
    }
  }
  stacks_.give_back(std::move(stacks));
}

void TaskCholesky::factorize_front(int s) {
  const int r = tree_.height(s), k = tree_.columns(s), m = r - k;
  const Contribution& update = contributions_[s];
  double* const l = panel(s);
  clear_panel(s, {0, k});
  add_children(s, {0, r}, {0, k});
  if (const int done = dense_.factorize_lower(l, r, k); done < k) return fail(tree_.first_columns[s] + done);
  dense_.divide_by_transposed(l + k, r, l, r, m, k);
  for (int q = 0; q < update.num_blocks(); ++q)
    dense_.subtract_square(From::zeros, update.block(q), update.stride(q), l + k + update.first(q), r, m - update.first(q),
                           update.last(q) - update.first(q), k);
  add_children(s, {k, r}, {k, r});
}

void TaskCholesky::factorize_tile(int s, int tile, int panel_number) {
  const Range rows = tile_rows(s, tile), columns = panel_columns(s, panel_number);
  const int r = tree_.height(s), earlier = columns.begin;
  double* const l = panel(s);
  double* const diagonal = column(s, columns.begin) + columns.begin;
  add_children(s, rows, columns);
  if (tile == panel_number) {
    dense_.subtract_square(From::present, diagonal, r, l + columns.begin, r, columns.size(), columns.size(), earlier);
    const int done = dense_.factorize_lower(diagonal, r, columns.size());
    if (done < columns.size()) fail(tree_.first_columns[s] + columns.begin + done);
    return;
  }
  double* const here = column(s, columns.begin) + rows.begin;
  dense_.subtract_product(From::present, here, r, l + rows.begin, r, l + columns.begin, r, rows.size(), columns.size(),
                          earlier);
  dense_.divide_by_transposed(here, r, diagonal, r, rows.size(), columns.size());
}

void TaskCholesky::factorize_block(int s, int i, int q) {
  const int r = tree_.height(s), k = tree_.columns(s);
  const Contribution& update = contributions_[s];
  const Range rows{update.first(i), update.last(i)}, columns{update.first(q), update.last(q)};
  const double* const l = panel(s) + k;
  double* const here = update.block(q) + rows.begin - columns.begin;
  if (i == q)
    dense_.subtract_square(From::zeros, here, update.stride(q), l + rows.begin, r, rows.size(), rows.size(), k);
  else
    dense_.subtract_product(From::zeros, here, update.stride(q), l + rows.begin, r, l + columns.begin, r, rows.size(),
                            columns.size(), k);
  add_children(s, {k + rows.begin, k + rows.end}, {k + columns.begin, k + columns.end});
}

/// The matrix's own entries in these columns of a front, and zeros.
void TaskCholesky::clear_panel(int s, Range columns) {
  std::fill_n(column(s, columns.begin), static_cast<std::size_t>(columns.size()) * tree_.height(s), 0.0);
  const int first = tree_.entry_starts[tree_.first_columns[s] + columns.begin];
  const int last = tree_.entry_starts[tree_.first_columns[s] + columns.end];
  for (int k = first; k < last; ++k) factor_.data()[tree_.entries[k]] = values_[sources_[k]];
}

/// Start of a front's column, whose rows count from the front's first one.
double* TaskCholesky::column(int s, int j) const {
  const int k = tree_.columns(s);
  return j < k ? panel(s) + static_cast<std::size_t>(j) * tree_.height(s) : contributions_[s].column(j - k) - k;
}

/// Adds the children's contributions in these rows and columns, child by child.
void TaskCholesky::add_children(int s, Range rows, Range columns) {
  for (const int child : tree_.children_of(s)) {
    const auto places = tree_.relative_below(child);
    const auto place = [&](int at) {
      return static_cast<int>(std::lower_bound(places.begin(), places.end(), at) - places.begin());
    };
    const int first = place(columns.begin), last = place(columns.end), begin = place(rows.begin), end = place(rows.end);
    for (int j = first; j < last; ++j)
      dense_.add_scattered(column(s, places[j]), contributions_[child].column(j), places.data(), std::max(j, begin), end);
  }
}

void TaskCholesky::fail(int column) {
  int before = failed_;
  while (column < before && !failed_.compare_exchange_weak(before, column)) {
  }
}

/// Makes room for the contribution of a root or of a front above.
void TaskCholesky::open(int s) {
  const std::size_t size = Contribution::size(tree_.below(s));
  if (size == 0) return;
  const auto excess = [&](const Doubles& free) {
    return free.size() / 2 > size ? -1 : static_cast<std::ptrdiff_t>(free.size()) - static_cast<std::ptrdiff_t>(size);
  };
  blocks_[s] = pool_.take(excess, [&] { return Doubles(size); });
  contributions_[s].values = blocks_[s].data();
}

void TaskCholesky::release(int s) {
  contributions_[s].values = nullptr;
  if (blocks_[s].size() > 0) pool_.give_back(std::exchange(blocks_[s], {}));
}

void TaskCholesky::release_children(int s) {
  for (const int child : tree_.children_of(s)) release(child);
}

std::size_t TaskCholesky::work_size() const {
  std::size_t size = 0;
  for (const Doubles& block : pool_.free()) size += block.size();
  for (const Stacks& stacks : stacks_.free()) size += stacks.values[0].size() + stacks.values[1].size();
  return size;
}

}  // namespace itr::backends
