// SPDX-License-Identifier: MIT
#include "assembly_tree.hpp"

namespace itr::backends {

bool AssemblyTree::assign(const SupernodalPattern& pattern) {
  size = static_cast<int>(pattern.first_columns.size()) - 1;
  order = pattern.first_columns[size];
  first_columns.assign(pattern.first_columns.begin(), pattern.first_columns.end());
  row_starts.assign(pattern.row_starts.begin(), pattern.row_starts.end());
  rows.assign(pattern.rows.begin(), pattern.rows.begin() + row_starts[size]);
  panels.assign(size + 1, 0);
  for (int s = 0; s < size; ++s) panels[s + 1] = panels[s] + static_cast<std::size_t>(height(s)) * columns(s);
  if (!assign_parents()) return false;
  assign_relative();
  assign_entries(pattern);
  return true;
}

bool AssemblyTree::assign_parents() {
  std::vector<int> front_of(order);
  for (int s = 0; s < size; ++s)
    for (int j = first_columns[s]; j < first_columns[s + 1]; ++j) front_of[j] = s;
  parent.assign(size, -1);
  child_starts.assign(size + 1, 0);
  for (int s = 0; s < size; ++s) {
    if (below(s) == 0) continue;
    parent[s] = front_of[rows_below(s)[0]];
    ++child_starts[parent[s] + 1];
  }
  for (int s = 0; s < size; ++s) child_starts[s + 1] += child_starts[s];
  children.resize(child_starts[size]);
  std::vector<int> next(child_starts.begin(), child_starts.end() - 1), least(size);
  for (int s = 0; s < size; ++s) {
    // In postorder, the fronts below one are those just before it: the children's ranges join without gaps.
    int begin = s;
    for (int k = next[s] - 1; k >= child_starts[s]; --k) {
      if (children[k] != begin - 1) return false;
      begin = least[children[k]];
    }
    least[s] = begin;
    if (parent[s] >= 0) children[next[parent[s]]++] = s;
  }
  return true;
}

void AssemblyTree::assign_relative() {
  relative.assign(rows.size(), 0);
  std::vector<int> place(order);
  for (int p = 0; p < size; ++p) {
    if (children_of(p).empty()) continue;
    for (int k = row_starts[p]; k < row_starts[p + 1]; ++k) place[rows[k]] = k - row_starts[p];
    for (const int child : children_of(p))
      for (int k = row_starts[child] + columns(child); k < row_starts[child + 1]; ++k) relative[k] = place[rows[k]];
  }
}

void AssemblyTree::assign_entries(const SupernodalPattern& pattern) {
  entry_starts.assign(pattern.column_starts.begin(), pattern.column_starts.end());
  entries.resize(pattern.row_indices.size());
  std::vector<int> place(order);
  for (int s = 0; s < size; ++s) {
    for (int k = row_starts[s]; k < row_starts[s + 1]; ++k) place[rows[k]] = k - row_starts[s];
    for (int j = first_columns[s]; j < first_columns[s + 1]; ++j) {
      const std::size_t column = panels[s] + static_cast<std::size_t>(j - first_columns[s]) * height(s);
      for (int k = entry_starts[j]; k < entry_starts[j + 1]; ++k) entries[k] = column + place[pattern.row_indices[k]];
    }
  }
}

double AssemblyTree::cost(int front) const {
  constexpr double kFlopsOfFront = 2e4, kFlopsOfEntry = 40;
  const double k = columns(front), m = below(front);
  return kFlopsOfFront + k * (k * (k / 3 + m) + m * m) + kFlopsOfEntry * (k * (k + m) + m * m / 2);
}

TreeCut::TreeCut(const AssemblyTree& tree, double most) : is_above(tree.size, 0) {
  std::vector<double> cost(tree.size);  // of all at and below a front
  for (int s = 0; s < tree.size; ++s) {
    cost[s] = tree.cost(s);
    for (const int child : tree.children_of(s)) cost[s] += cost[child];
    is_above[s] = cost[s] > most;
  }
  double sum = 0;
  for (int s = 0; s < tree.size; ++s) {
    if (is_above[s]) {
      sum = most;
      continue;
    }
    const bool is_top = tree.parent[s] < 0 || is_above[tree.parent[s]];
    if (!is_top) continue;
    const int begin = pieces.empty() ? 0 : pieces.back().end;
    // The fronts above between the last piece and this one belong to none.
    int first = s;
    while (first > begin && !is_above[first - 1]) --first;
    if (first > begin || pieces.empty() || sum + cost[s] > most) {
      pieces.push_back({first, s + 1});
      sum = cost[s];
    } else {
      pieces.back().end = s + 1;
      sum += cost[s];
    }
  }
}

}  // namespace itr::backends
