// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>

#include "itr/types.hpp"

namespace itr {

/// A vector whose memory stays when its length changes, where Eigen's own is made anew. It begins at an address as aligned
/// as theirs, so that sums have the same bits.
class ScratchVector {
 public:
  ScratchVector() = default;
  ScratchVector& operator=(ConstVectorView values) {
    resize(values.size()) = values;
    return *this;
  }
  /// Entries are undefined from then on; views from before are no longer valid.
  VectorView resize(Eigen::Index size) {
    if (size > storage_.size()) storage_.resize(std::max(size, 2 * storage_.size()));
    size_ = size;
    return view();
  }
  Eigen::Index size() const { return size_; }
  VectorView view() { return storage_.head(size_); }
  ConstVectorView view() const { return storage_.head(size_); }
  /// As a matrix of that many rows, by columns.
  Eigen::Map<MatrixX> matrix(Eigen::Index rows) { return {storage_.data(), rows, rows > 0 ? size_ / rows : 0}; }

 private:
  VectorX storage_;
  Eigen::Index size_ = 0;
};

}  // namespace itr
