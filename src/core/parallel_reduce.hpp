// SPDX-License-Identifier: MIT
// Loops whose results meet in one place, with the same bits for any number of threads.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include "core/parallel.hpp"
#include "core/profile.hpp"

namespace itr {

/// Least of body(begin, end) over blocks of [0, n); infinity where n is 0.
template <typename Body>
double parallel_min(std::size_t n, std::size_t block, const Body& body) {
  if (n == 0) return std::numeric_limits<double>::infinity();
  if (n <= block) return std::min(std::numeric_limits<double>::infinity(), body(0, n));
  std::vector<double> partial((n + block - 1) / block);
  parallel_blocks(n, block, [&](std::size_t begin, std::size_t end) { partial[begin / block] = body(begin, end); });
  double least = std::numeric_limits<double>::infinity();
  for (const double value : partial) least = std::min(least, value);
  return least;
}

/// Computes make(i) for i < n on all threads, and calls use(i, value) with each in ascending order on this one.
template <typename T, typename Make, typename Use>
void parallel_then_ordered(std::size_t n, std::size_t block, const Make& make, const Use& use) {
  if (n <= block || (num_threads() == 1 && !Profile::active())) {  // a profile times the blocks that threads would take
    for (std::size_t i = 0; i < n; ++i) use(i, make(i));
    return;
  }
  const std::size_t batch = 16 * block;
  std::vector<T> values(std::min(n, batch));
  for (std::size_t first = 0; first < n; first += batch) {
    const std::size_t count = std::min(batch, n - first);
    parallel_blocks(count, block, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) values[i] = make(first + i);
    });
    for (std::size_t i = 0; i < count; ++i) use(first + i, values[i]);
  }
}

}  // namespace itr
