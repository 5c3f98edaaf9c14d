// SPDX-License-Identifier: MIT
// The only place that knows the threading library. Loops write to disjoint places; reductions add fixed blocks in a fixed
// order, so that results have the same bits for any number of threads.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace itr {

/// Limits the number of threads of all parallel loops run while it lives (0 = as many as there are cores).
class ThreadLimit {
 public:
  explicit ThreadLimit(int threads);
  ~ThreadLimit();
  ThreadLimit(const ThreadLimit&) = delete;
  ThreadLimit& operator=(const ThreadLimit&) = delete;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Threads that a parallel loop would use now.
int num_threads();

/// Calls body(begin, end) on blocks of [0, n) of `block` items, in any order and possibly at the same time. Blocks do not
/// depend on the number of threads. One block runs in the calling thread without any overhead.
void parallel_blocks(std::size_t n, std::size_t block, const std::function<void(std::size_t, std::size_t)>& body);

/// Sum of body(begin, end) over the same blocks, added in block order.
double parallel_sum(std::size_t n, std::size_t block, const std::function<double(std::size_t, std::size_t)>& body);

}  // namespace itr
