// SPDX-License-Identifier: MIT
#include "itr/core/parallel.hpp"

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <vector>

namespace itr {

struct ThreadLimit::Impl {
  tbb::global_control control;
};

ThreadLimit::ThreadLimit(int threads) {
  if (threads > 0) impl_.reset(new Impl{tbb::global_control(tbb::global_control::max_allowed_parallelism, threads)});
}
ThreadLimit::~ThreadLimit() = default;

int num_threads() {
  return static_cast<int>(
      std::min<std::size_t>(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism),
                            tbb::this_task_arena::max_concurrency()));
}

void parallel_blocks(std::size_t n, std::size_t block, const std::function<void(std::size_t, std::size_t)>& body) {
  if (n == 0) return;
  const std::size_t blocks = (n + block - 1) / block;
  const auto run = [&](std::size_t b) { body(b * block, std::min(n, (b + 1) * block)); };
  if (blocks == 1 || num_threads() == 1) {
    for (std::size_t b = 0; b < blocks; ++b) run(b);
    return;
  }
  tbb::parallel_for(std::size_t{0}, blocks, run);
}

double parallel_sum(std::size_t n, std::size_t block, const std::function<double(std::size_t, std::size_t)>& body) {
  if (n <= block) return n > 0 ? body(0, n) : 0;
  std::vector<double> partial((n + block - 1) / block, 0.0);
  parallel_blocks(n, block, [&](std::size_t begin, std::size_t end) { partial[begin / block] = body(begin, end); });
  double sum = 0;
  for (const double p : partial) sum += p;
  return sum;
}

}  // namespace itr
