// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <numeric>
#include <span>
#include <vector>

namespace itr {

/// By vertex: the number of the connected part that its cells make, parts in the order of their first vertices.
template <std::size_t Corners>
std::vector<int> connected_parts(std::size_t num_vertices, std::span<const std::array<int, Corners>> cells) {
  std::vector<int> root(num_vertices);
  std::iota(root.begin(), root.end(), 0);
  const auto find = [&](int v) {
    while (root[v] != v) v = root[v] = root[root[v]];
    return v;
  };
  for (const auto& cell : cells)
    for (std::size_t k = 1; k < Corners; ++k) {
      const int a = find(cell[0]), b = find(cell[k]);
      root[std::max(a, b)] = std::min(a, b);
    }
  std::vector<int> part(num_vertices);
  int parts = 0;
  for (int v = 0; v < static_cast<int>(num_vertices); ++v) part[v] = find(v) == v ? parts++ : part[find(v)];
  return part;
}

}  // namespace itr
