// SPDX-License-Identifier: MIT
#include "fem/hessian_sink.hpp"

#include <algorithm>
#include <utility>

#include "core/count.hpp"
#include "core/profile.hpp"

namespace itr {

namespace {
constexpr const char* kNonzeros = "nonzeros of the Newton system";
constexpr std::size_t kEntriesPerTask = 2048;

/// An entry of the base pattern, and the number of the blocks that is added to it.
struct Target {
  int nonzero, source;
};

/// Stable, digit by digit: many times faster than by comparisons. Numbers are below `end`.
void sort_by_nonzero(std::vector<Target>& targets, std::size_t end) {
  constexpr int kBits = 11;
  std::vector<Target> sorted(targets.size());
  for (int shift = 0; end >> shift > 0; shift += kBits) {
    std::array<std::size_t, (1 << kBits) + 1> first{};
    const auto digit = [&](const Target& target) { return target.nonzero >> shift & ((1 << kBits) - 1); };
    for (const Target& target : targets) ++first[digit(target) + 1];
    for (int d = 0; d < 1 << kBits; ++d) first[d + 1] += first[d];
    for (const Target& target : targets) sorted[first[digit(target)]++] = target;
    targets.swap(sorted);
  }
}
}  // namespace

DofMap DofMap::from_held(const std::vector<char>& held) {
  DofMap map;
  map.hold(held);
  return map;
}

void DofMap::hold(const std::vector<char>& held) {
  num_unknowns = 0;
  unknown.resize(held.size());
  for (std::size_t i = 0; i < held.size(); ++i) unknown[i] = held[i] ? kNone : num_unknowns++;
}

void SparseAssembler::reset(const DofMap& dofs, int dim, std::vector<Stencils> stencils) {
  place_.clear();
  changed_ = true;
  if (dim == dim_ && dofs.unknown == unknown_ && stencils == stencils_) {
    pattern_ = base_;
    return;
  }
  pattern_ = {};
  gathers_.clear();
  unknown_ = dofs.unknown;
  stencils_ = std::move(stencils);
  cached_.assign(stencils_.size(), {});
  dim_ = dim;
  const std::size_t num_vertices = unknown_.size() / dim;
  std::vector<std::vector<int>> neighbors(num_vertices);  // and the vertex itself: without cells it still has a diagonal
  for (std::size_t v = 0; v < num_vertices; ++v) neighbors[v].push_back(static_cast<int>(v));
  for (const auto& [vertices, size] : stencils_)
    for (std::size_t s = 0; s < vertices.size(); s += size)
      for (int i = 0; i < size; ++i)
        for (int j = 0; j < size; ++j)
          if (vertices[s + j] > vertices[s + i]) neighbors[vertices[s + i]].push_back(vertices[s + j]);
  pattern_.order = dofs.num_unknowns;
  pattern_.column_starts.assign(1, 0);
  for (std::size_t v = 0; v < num_vertices; ++v) {
    auto& around = neighbors[v];
    std::sort(around.begin(), around.end());
    around.erase(std::unique(around.begin(), around.end()), around.end());
    for (int c = 0; c < dim; ++c) {
      const int column = unknown_[dim * v + c];
      if (column == kNone) continue;
      for (const int w : around)
        for (int d = 0; d < dim; ++d)
          if (const int row = unknown_[dim * w + d]; row >= column) pattern_.row_indices.push_back(row);
      pattern_.column_starts.push_back(as_index(pattern_.row_indices.size(), kNonzeros));
    }
  }
  base_ = pattern_;
  for (const Stencils& kind : stencils_) gathers_.emplace_back((kind.count() + kBatch - 1) / kBatch);
}

const SparseAssembler::Gather& SparseAssembler::gather(std::size_t kind, std::size_t batch) {
  Gather& result = gathers_[kind][batch];
  if (!result.offset.empty()) return result;
  const Stencils& stencils = stencils_[kind];
  const std::size_t first = batch * kBatch, count = std::min(kBatch, stencils.count() - first);
  const int side = dim_ * stencils.size;
  std::vector<Target> entries;
  entries.reserve(count * side * (side + 1) / 2);
  std::vector<int> unknown(side);
  for (std::size_t s = 0; s < count; ++s) {
    const int* vertices = &stencils.vertices[(first + s) * stencils.size];
    for (int i = 0; i < side; ++i) unknown[i] = unknown_[dim_ * vertices[i / dim_] + i % dim_];
    for (int j = 0; j < side; ++j) {
      if (unknown[j] == kNone) continue;
      const auto begin = base_.row_indices.begin() + base_.column_starts[unknown[j]];
      const auto end = base_.row_indices.begin() + base_.column_starts[unknown[j] + 1];
      auto at = begin;
      for (int i = 0; i < side; ++i) {
        if (unknown[i] < unknown[j]) continue;  // above the diagonal, or held
        // Rows of one vertex follow each other.
        if (at == end || ++at == end || *at != unknown[i]) at = std::lower_bound(begin, end, unknown[i]);
        entries.push_back({static_cast<int>(at - base_.row_indices.begin()), static_cast<int>((s * side + j) * side + i)});
      }
    }
  }
  sort_by_nonzero(entries, base_.row_indices.size());
  for (std::size_t k = 0; k < entries.size(); ++k) {
    if (k == 0 || entries[k].nonzero != entries[k - 1].nonzero) {
      result.nonzero.push_back(entries[k].nonzero);
      result.offset.push_back(static_cast<int>(k));
    }
    result.source.push_back(entries[k].source);
  }
  result.offset.push_back(static_cast<int>(entries.size()));
  return result;
}

void SparseAssembler::add_batch(std::size_t kind, std::size_t first, const double* blocks) {
  const Gather& list = gather(kind, first / kBatch);
  add_bytes(static_cast<double>((sizeof(double) + sizeof(int)) * (list.source.size() + 2 * list.nonzero.size())));
  parallel_blocks(list.nonzero.size(), kEntriesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      double sum = 0;
      for (int i = list.offset[k]; i < list.offset[k + 1]; ++i) sum += blocks[list.source[i]];
      values_[place(list.nonzero[k])] += sum;
    }
  });
}

bool SparseAssembler::add_cached(std::size_t kind, std::span<const double> factors, std::span<const double> block) {
  if (kind >= cached_.size()) return false;
  const Cached& cached = cached_[kind];
  if (cached.factors.empty() || !std::ranges::equal(cached.factors, factors) || !std::ranges::equal(cached.block, block))
    return false;
  parallel_blocks(cached.sum.size(), kEntriesPerTask, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) values_[place(static_cast<int>(k))] += cached.sum[k];
  });
  return true;
}

void SparseAssembler::begin_keeping() {
  others_ = values_;
  std::fill(values_.begin(), values_.end(), 0.0);
}

void SparseAssembler::end_keeping(std::size_t kind, std::span<const double> factors, std::span<const double> block) {
  cached_.resize(std::max(cached_.size(), kind + 1));
  Cached& cached = cached_[kind];
  cached.factors.assign(factors.begin(), factors.end());
  cached.block.assign(block.begin(), block.end());
  cached.sum.resize(base_.row_indices.size());
  for (std::size_t k = 0; k < cached.sum.size(); ++k) cached.sum[k] = values_[place(static_cast<int>(k))];
  values_ = others_;
  add_cached(kind, factors, block);
}

void SparseAssembler::begin() {
  values_.assign(pattern_.nonzeros(), 0.0);
  overflow_.clear();
  last_ = kNone;
}

void SparseAssembler::add(int row, int column, double value) {
  // Rows of one vertex follow each other, so the next entry is often right behind the last.
  const int next = last_ + 1;
  if (next > pattern_.column_starts[column] && next < pattern_.column_starts[column + 1] &&
      pattern_.row_indices[next] == row) {
    values_[last_ = next] += value;
    return;
  }
  const auto first = pattern_.row_indices.begin() + pattern_.column_starts[column];
  const auto last = pattern_.row_indices.begin() + pattern_.column_starts[column + 1];
  const auto it = std::lower_bound(first, last, row);
  if (it != last && *it == row)
    values_[last_ = static_cast<int>(it - pattern_.row_indices.begin())] += value;
  else
    overflow_.push_back({column, row, value});
}

bool SparseAssembler::finish() {
  if (!overflow_.empty()) {
    std::stable_sort(overflow_.begin(), overflow_.end(), [](const Entry& a, const Entry& b) {
      return a.column != b.column ? a.column < b.column : a.row < b.row;
    });
    linear::SparsityPattern grown;
    std::vector<double> values;
    std::vector<int> moved(pattern_.row_indices.size());  // to where in the grown pattern
    grown.order = pattern_.order;
    grown.column_starts.push_back(0);
    std::size_t next = 0;
    for (int j = 0; j < pattern_.order; ++j) {
      int p = pattern_.column_starts[j];
      const int end = pattern_.column_starts[j + 1];
      while (p < end || (next < overflow_.size() && overflow_[next].column == j)) {
        const bool take_old = next == overflow_.size() || overflow_[next].column != j ||
                              (p < end && pattern_.row_indices[p] < overflow_[next].row);
        const int row = take_old ? pattern_.row_indices[p] : overflow_[next].row;
        const double value = take_old ? values_[p] : overflow_[next++].value;
        const bool same_row =
            std::cmp_greater(grown.row_indices.size(), grown.column_starts.back()) && grown.row_indices.back() == row;
        if (same_row) {
          values.back() += value;
        } else {
          grown.row_indices.push_back(row);
          values.push_back(value);
        }
        if (take_old) moved[p++] = as_index(grown.row_indices.size(), kNonzeros) - 1;
      }
      grown.column_starts.push_back(as_index(grown.row_indices.size(), kNonzeros));
    }
    if (place_.empty()) {
      place_ = std::move(moved);
    } else {
      for (int& at : place_) at = moved[at];
    }
    pattern_ = std::move(grown);
    values_ = std::move(values);
    overflow_.clear();
    changed_ = true;
  }
  return std::exchange(changed_, false);
}

template <int Dim>
void HessianTarget::add(std::span<const int> vertices, const double* block) {
  const int n = Dim * static_cast<int>(vertices.size());
  if (receiver_) return receiver_(vertices, block);
  constexpr int kUsual = 24;
  std::array<int, kUsual> few;
  std::vector<int> many(n > kUsual ? n : 0);
  int* const unknown = n > kUsual ? many.data() : few.data();
  for (int i = 0; i < n; ++i) unknown[i] = dofs_->unknown[Dim * vertices[i / Dim] + i % Dim];
  for (int j = 0; j < n; ++j) {
    const int column = unknown[j];
    if (column == kNone) continue;
    for (int i = 0; i < n; ++i) {
      const int row = unknown[i];
      const double value = block[n * j + i];
      if (row < column || value == 0) continue;  // kNone is below every unknown; half of a mass block is zero
      if (sparse_)
        sparse_->add(row, column, value);
      else
        dense_[dense_stride_ * column + row] += value;
    }
  }
  if (motion_) add_motion<Dim>(vertices, block);
}

template <int Dim>
void HessianTarget::add_motion(std::span<const int> vertices, const double* block) {
  const int n = Dim * static_cast<int>(vertices.size());
  for (int j = 0; j < n; ++j) {
    const int dof = Dim * vertices[j / Dim] + j % Dim;
    if (dofs_->unknown[dof] != kNone) continue;
    for (int i = 0; i < n; ++i) {
      const int other = Dim * vertices[i / Dim] + i % Dim;
      const double product = block[n * j + i] * motion_->step[dof];
      if (const int row = dofs_->unknown[other]; row != kNone)
        motion_->coupling[row] += product;
      else
        motion_->curvature += motion_->step[other] * product;
    }
  }
}

HessianSink::HessianSink(BlockReceiver receiver)
    : own_(std::make_shared<HessianTarget>(std::move(receiver))), target_(own_.get()) {}

template <int Dim>
void HessianSink::add(std::span<const int> vertices, const double* block) {
  target_->add<Dim>(vertices, block);
}

template void HessianSink::add<2>(std::span<const int>, const double*);
template void HessianSink::add<3>(std::span<const int>, const double*);
template void HessianTarget::add<2>(std::span<const int>, const double*);
template void HessianTarget::add<3>(std::span<const int>, const double*);
template void HessianTarget::add_motion<2>(std::span<const int>, const double*);
template void HessianTarget::add_motion<3>(std::span<const int>, const double*);

}  // namespace itr
