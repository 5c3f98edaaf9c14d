// SPDX-License-Identifier: MIT
// Both triangles of a symmetric matrix whose lower one is given, for libraries that want them.
#pragma once

#include <cstddef>
#include <vector>

#include "itr/module.h"

namespace itr::backends {

/// Compressed columns (or rows: it is symmetric), indices ascending.
struct FullMatrix {
  int order = 0;
  std::vector<int> starts;  ///< order + 1
  std::vector<int> indices;
  std::vector<double> values;

  void set_pattern(const itr_pattern& lower) {
    order = lower.order;
    starts.assign(order + 1, 0);
    for (int j = 0; j < order; ++j)
      for (int p = lower.column_starts[j]; p < lower.column_starts[j + 1]; ++p) {
        ++starts[j + 1];
        if (lower.row_indices[p] != j) ++starts[lower.row_indices[p] + 1];
      }
    for (int j = 0; j < order; ++j) starts[j + 1] += starts[j];
    indices.resize(starts[order]);
    values.assign(indices.size(), 0.0);
    below_.clear();
    above_.clear();
    // Column by column: the entries above the diagonal of column i come in the order of their rows j < i, before its own.
    std::vector<int> next(starts.begin(), starts.end() - 1);
    for (int j = 0; j < order; ++j)
      for (int p = lower.column_starts[j]; p < lower.column_starts[j + 1]; ++p) {
        const int i = lower.row_indices[p];
        below_.push_back(next[j]);
        indices[next[j]++] = i;
        above_.push_back(below_.back());
        if (i == j) continue;
        above_.back() = next[i];
        indices[next[i]++] = j;
      }
  }
  void set_values(const double* lower, std::size_t count) {
    for (std::size_t k = 0; k < count; ++k) values[below_[k]] = values[above_[k]] = lower[k];
  }

 private:
  std::vector<int> below_, above_;  ///< where each entry of the lower triangle goes
};

}  // namespace itr::backends
