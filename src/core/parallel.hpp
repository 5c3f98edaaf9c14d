// SPDX-License-Identifier: MIT
// The only place that knows the threading library. Loops write to disjoint places; reductions add fixed blocks in a fixed
// order, so that results have the same bits for any number of threads.
#pragma once

#include <algorithm>
#include <cstddef>
#include <functional>
#include <vector>

#include "itr/core.hpp"

namespace itr {

/// Calls body(begin, end) on blocks of [0, n) of `block` items, in any order and possibly at the same time. Blocks do not
/// depend on the number of threads. One block runs in the calling thread without any overhead.
void parallel_blocks(std::size_t n, std::size_t block, const std::function<void(std::size_t, std::size_t)>& body);

/// Sum of body(begin, end) over the same blocks, added in block order.
double parallel_sum(std::size_t n, std::size_t block, const std::function<double(std::size_t, std::size_t)>& body);

// Runs any callable object over blocks; std::function would allocate a copy of it.
template <typename Body>
void parallel_blocks(std::size_t n, std::size_t block, const Body& body) {
  parallel_blocks(n, block, std::function<void(std::size_t, std::size_t)>(std::cref(body)));
}
template <typename Body>
double parallel_sum(std::size_t n, std::size_t block, const Body& body) {
  return parallel_sum(n, block, std::function<double(std::size_t, std::size_t)>(std::cref(body)));
}

/// Sorts by an order that tells all items apart, but for equal ones that are the same; blocks that do not depend on the
/// number of threads are sorted and merged.
template <typename T, typename Less>
void parallel_sort(std::vector<T>& items, const Less& less) {
  constexpr std::size_t kBlock = 2048;
  const std::size_t n = items.size();
  const auto at = [&](std::size_t i) { return items.begin() + static_cast<std::ptrdiff_t>(std::min(i, n)); };
  parallel_blocks(n, kBlock, [&](std::size_t begin, std::size_t end) { std::sort(at(begin), at(end), less); });
  for (std::size_t width = kBlock; width < n; width *= 2)
    parallel_blocks((n + 2 * width - 1) / (2 * width), 1, [&](std::size_t pair, std::size_t) {
      const std::size_t begin = 2 * width * pair;
      std::inplace_merge(at(begin), at(begin + width), at(begin + 2 * width), less);
    });
}

}  // namespace itr
