// SPDX-License-Identifier: MIT
#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <utility>
#include <vector>

namespace itr::backends {

/// Seconds of a run.
struct TaskTimes {
  double wall = 0;
  double work = 0;  ///< sum over all tasks
  double span = 0;  ///< sum over the longest chain of tasks that wait for each other
};

/// Tasks with the tasks that each one waits for. It is made once, and run as often as one likes.
class TaskGraph {
 public:
  /// `cost` in any unit: of two tasks that are ready, that with the costlier chain behind it comes first.
  int add(double cost);
  /// `task` waits for `earlier`, which was added before.
  void wait_for(int task, int earlier) { edges_.emplace_back(earlier, task); }
  /// No more tasks.
  void finish();
  void clear() { *this = {}; }
  int size() const { return static_cast<int>(costs_.size()); }

  /// Calls `work` with each task's number, in their order on one thread or where `is_short`, so that it is not worth to wake
  /// others, else as soon as what they wait for is done. Work that writes where no other task does that may run at the same
  /// time has the same results on any number of threads.
  void run(const std::function<void(int)>& work, bool is_short);
  /// Seconds of the last run, by the clock.
  const TaskTimes& times() const { return times_; }

 private:
  struct Run;
  void run_in_threads(const std::function<void(int)>& work) const;
  /// Longest chain, in the unit of these costs.
  double span(std::vector<double> costs) const;

  std::vector<double> costs_, seconds_;
  TaskTimes times_;
  std::vector<std::pair<int, int>> edges_;     ///< (earlier, later), until finish()
  std::vector<int> starts_, later_, waiting_;  ///< those that wait for a task, by starts_; how many it waits for
  std::vector<int> first_;                     ///< those that wait for none
};

}  // namespace itr::backends
