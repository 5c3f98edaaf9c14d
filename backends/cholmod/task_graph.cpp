// SPDX-License-Identifier: MIT
#include "task_graph.hpp"

#include <tbb/global_control.h>
#include <tbb/task_arena.h>
#include <tbb/task_group.h>

#include <algorithm>
#include <chrono>
#include <new>
#include <numeric>
#include <stdexcept>

namespace itr::backends {

namespace {

/// Threads of the caller's arena, within the limit of the process.
std::size_t num_threads() {
  return std::min<std::size_t>(tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism),
                               tbb::this_task_arena::max_concurrency());
}

double seconds_now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

}  // namespace

/// A run on several threads.
struct TaskGraph::Run {
  const TaskGraph& graph;
  const std::function<void(int)>& work;
  std::vector<std::atomic<int>> waiting;
  std::atomic<int> left;  ///< orders what tasks have written before what follows the run
  tbb::task_group group;

  Run(const TaskGraph& of, const std::function<void(int)>& what)
      : graph(of), work(what), waiting(of.waiting_.size()), left(of.size()) {
    for (std::size_t t = 0; t < waiting.size(); ++t) waiting[t].store(graph.waiting_[t], std::memory_order_release);
  }
  void start(int task) {
    group.run([this, task] { go_on(task); });
  }
  /// Does a task, then the most urgent of those that have waited for it only; the others go to any thread.
  void go_on(int task) {
    while (task >= 0) {
      waiting[task].load(std::memory_order_acquire);
      work(task);
      int next = -1;
      for (int k = graph.starts_[task]; k < graph.starts_[task + 1]; ++k)
        if (waiting[graph.later_[k]].fetch_sub(1, std::memory_order_acq_rel) == 1) {
          if (next >= 0) start(next);
          next = graph.later_[k];
        }
      left.fetch_sub(1, std::memory_order_acq_rel);
      task = next;
    }
  }
};

int TaskGraph::add(double cost) {
  costs_.push_back(cost);
  return size() - 1;
}

void TaskGraph::finish() {
  const int n = size();
  starts_.assign(n + 1, 0);
  waiting_.assign(n, 0);
  for (const auto& [earlier, later] : edges_) {
    ++starts_[earlier + 1];
    ++waiting_[later];
  }
  for (int t = 0; t < n; ++t) starts_[t + 1] += starts_[t];
  later_.resize(edges_.size());
  std::vector<int> next(starts_.begin(), starts_.end() - 1);
  for (const auto& [earlier, later] : edges_) later_[next[earlier]++] = later;
  std::vector<double> chain = costs_;
  for (int t = n - 1; t >= 0; --t) {
    const auto begin = later_.begin() + starts_[t], end = later_.begin() + starts_[t + 1];
    std::sort(begin, end, [&](int a, int b) { return std::pair(chain[a], b) < std::pair(chain[b], a); });
    if (begin != end) chain[t] += chain[*(end - 1)];
  }
  for (int t = n - 1; t >= 0; --t)  // the first one is started last, so that this thread takes it
    if (waiting_[t] == 0) first_.push_back(t);
  edges_ = {};
}

void TaskGraph::run_in_threads(const std::function<void(int)>& work) const {
  try {
    Run now(*this, work);
    for (const int task : first_) now.start(task);
    now.group.wait();
    now.left.load(std::memory_order_acquire);
  } catch (const std::runtime_error&) {  // of TBB, which found no room for the stack of a thread
    throw std::bad_alloc();
  }
}

void TaskGraph::run(const std::function<void(int)>& work, bool is_short) {
  seconds_.resize(size());
  const std::function<void(int)> timed = [&](int task) {
    const double start = seconds_now();
    work(task);
    seconds_[task] = seconds_now() - start;
  };
  const double start = seconds_now();
  if (is_short || size() < 2 || num_threads() < 2) {
    for (int t = 0; t < size(); ++t) timed(t);
  } else {
    run_in_threads(timed);
  }
  const double sum = std::accumulate(seconds_.begin(), seconds_.end(), 0.0);
  times_ = {seconds_now() - start, sum, is_short ? sum : span(seconds_)};
}

double TaskGraph::span(std::vector<double> costs) const {
  double longest = 0;
  for (int t = size() - 1; t >= 0; --t) {
    double after = 0;
    for (int k = starts_[t]; k < starts_[t + 1]; ++k) after = std::max(after, costs[later_[k]]);
    costs[t] += after;
    longest = std::max(longest, costs[t]);
  }
  return longest;
}

}  // namespace itr::backends
