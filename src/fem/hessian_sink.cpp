// SPDX-License-Identifier: MIT
#include "itr/fem/hessian_sink.hpp"

#include <algorithm>
#include <utility>

namespace itr {

DofMap DofMap::from_held(const std::vector<char>& held) {
  DofMap map;
  map.unknown.resize(held.size());
  for (std::size_t i = 0; i < held.size(); ++i) map.unknown[i] = held[i] ? kNone : map.num_unknowns++;
  return map;
}

void SparseAssembler::reset(const DofMap& dofs, int dim, std::span<const int> stencils, int stencil_size) {
  const int n = dofs.num_unknowns;
  std::vector<std::vector<int>> columns(n);
  std::vector<int> unknowns;
  for (std::size_t s = 0; s < stencils.size(); s += stencil_size) {
    unknowns.clear();
    for (int k = 0; k < stencil_size; ++k)
      for (int c = 0; c < dim; ++c)
        if (const int u = dofs.unknown[dim * stencils[s + k] + c]; u != kNone) unknowns.push_back(u);
    for (const int j : unknowns)
      for (const int i : unknowns)
        if (i >= j) columns[j].push_back(i);
  }
  pattern_.order = n;
  pattern_.column_starts.assign(1, 0);
  pattern_.row_indices.clear();
  for (int j = 0; j < n; ++j) {
    columns[j].push_back(j);  // a vertex without cells still has a diagonal
    std::sort(columns[j].begin(), columns[j].end());
    columns[j].erase(std::unique(columns[j].begin(), columns[j].end()), columns[j].end());
    pattern_.row_indices.insert(pattern_.row_indices.end(), columns[j].begin(), columns[j].end());
    pattern_.column_starts.push_back(static_cast<int>(pattern_.row_indices.size()));
  }
  changed_ = true;
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
        const double value = take_old ? values_[p++] : overflow_[next++].value;
        const bool same_row =
            static_cast<int>(grown.row_indices.size()) > grown.column_starts.back() && grown.row_indices.back() == row;
        if (same_row) {
          values.back() += value;
        } else {
          grown.row_indices.push_back(row);
          values.push_back(value);
        }
      }
      grown.column_starts.push_back(static_cast<int>(grown.row_indices.size()));
    }
    pattern_ = std::move(grown);
    values_ = std::move(values);
    overflow_.clear();
    changed_ = true;
  }
  return std::exchange(changed_, false);
}

template <int Dim>
void HessianSink::add(std::span<const int> vertices, const double* block) {
  const int n = Dim * static_cast<int>(vertices.size());
  constexpr int kMaxDofs = 12;
  int dof[kMaxDofs], unknown[kMaxDofs];
  for (int i = 0; i < n; ++i) {
    dof[i] = Dim * vertices[i / Dim] + i % Dim;
    unknown[i] = dofs_.unknown[dof[i]];
  }
  for (int j = 0; j < n; ++j) {
    const int column = unknown[j];
    for (int i = 0; i < n; ++i) {
      const int row = unknown[i];
      const double value = block[n * j + i];
      if (value == 0) continue;  // half of a mass block
      if (column == kNone) {
        if (!motion_) continue;
        const double product = value * motion_->step[dof[j]];
        if (row == kNone)
          motion_->curvature += motion_->step[dof[i]] * product;
        else
          motion_->coupling[row] += product;
      } else if (row >= column) {  // kNone is below every unknown
        if (dense_)
          (*dense_)(row, column) += value;
        else
          sparse_->add(row, column, value);
      }
    }
  }
}

template void HessianSink::add<2>(std::span<const int>, const double*);
template void HessianSink::add<3>(std::span<const int>, const double*);

}  // namespace itr
