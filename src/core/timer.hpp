// SPDX-License-Identifier: MIT
#pragma once

#include <chrono>

namespace itr {

inline double seconds_now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Adds the time of its scope to `total` [s].
class ScopedTimer {
 public:
  explicit ScopedTimer(double& total) : total_(total), start_(seconds_now()) {}
  ~ScopedTimer() { total_ += seconds_now() - start_; }
  ScopedTimer(const ScopedTimer&) = delete;
  ScopedTimer& operator=(const ScopedTimer&) = delete;

 private:
  double& total_;
  double start_;
};

}  // namespace itr
