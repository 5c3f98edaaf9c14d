// SPDX-License-Identifier: MIT
#include "core/parallel.hpp"

#include <tbb/blocked_range.h>
#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <vector>

#include "core/process.hpp"
#include "core/profile.hpp"

#ifdef __SANITIZE_THREAD__
#include <sanitizer/tsan_interface.h>
#endif

namespace itr {

namespace {

/// Tells ThreadSanitizer that a loop's blocks come after its start and before its end, which the scheduler does where the
/// sanitizer cannot see it. Blocks are not ordered among themselves.
struct LoopOrder {
#ifdef __SANITIZE_THREAD__
  char start = 0, end = 0;
  LoopOrder() { __tsan_release(&start); }
  void begin_block() { __tsan_acquire(&start); }
  void end_block() { __tsan_release(&end); }
  void finish() { __tsan_acquire(&end); }
#else
  void begin_block() {}
  void end_block() {}
  void finish() {}
#endif
};

}  // namespace

struct ThreadLimit::Impl {
  tbb::global_control control;
};

ThreadLimit::ThreadLimit(int threads)
    : impl_(new Impl{{tbb::global_control::max_allowed_parallelism,
                      static_cast<std::size_t>(threads > 0 ? threads : available_cores())}}) {}
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
  if (blocks == 1) return run(0);
  LoopTimer timer;
  if (num_threads() == 1) {
    for (std::size_t b = 0; b < blocks; ++b) timer.run([&] { run(b); });
    return;
  }
  LoopOrder order;
  tbb::parallel_for(std::size_t{0}, blocks, [&](std::size_t b) {
    order.begin_block();
    timer.run([&] { run(b); });
    order.end_block();
  });
  order.finish();
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
