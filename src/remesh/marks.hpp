// SPDX-License-Identifier: MIT
#pragma once

#include <utility>
#include <vector>

namespace itr {

/// Marks of vertices or cells that are cleared in O(1).
class Marks {
 public:
  void clear(int size) {
    if (static_cast<int>(stamp_.size()) < size) stamp_.resize(size, 0);
    ++now_;
  }
  bool operator[](int i) const { return i < static_cast<int>(stamp_.size()) && stamp_[i] == now_; }
  /// True the first time.
  bool mark(int i) {
    if (i >= static_cast<int>(stamp_.size())) stamp_.resize(2 * i + 16, 0);
    return std::exchange(stamp_[i], now_) != now_;
  }

 private:
  std::vector<unsigned> stamp_;
  unsigned now_ = 0;
};

}  // namespace itr
