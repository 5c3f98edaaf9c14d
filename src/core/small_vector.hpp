// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <initializer_list>
#include <span>
#include <type_traits>
#include <vector>

namespace itr {

/// A list that holds its first `N` entries in itself: what is usually short then takes no memory of its own. Longer ones
/// live on the heap as a whole.
template <typename T, std::size_t N>
class SmallVector {
  static_assert(std::is_trivially_copyable_v<T>);

 public:
  using value_type = T;

  SmallVector() = default;
  SmallVector(std::initializer_list<T> items) { assign(items.begin(), items.end()); }
  template <typename Range>
  requires(!std::is_same_v<std::remove_cvref_t<Range>, SmallVector> &&
           std::is_convertible_v<const Range&, std::span<const T>>)
      SmallVector(const Range& items) {  // NOLINT(google-explicit-constructor): a list by another name
    assign(items.begin(), items.end());
  }

  T* data() { return is_long() ? many_.data() : few_.data(); }
  const T* data() const { return is_long() ? many_.data() : few_.data(); }
  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  T* begin() { return data(); }
  T* end() { return data() + size_; }
  const T* begin() const { return data(); }
  const T* end() const { return data() + size_; }
  T& operator[](std::size_t i) { return data()[i]; }
  const T& operator[](std::size_t i) const { return data()[i]; }
  T& front() { return data()[0]; }
  const T& front() const { return data()[0]; }
  T& back() { return data()[size_ - 1]; }
  const T& back() const { return data()[size_ - 1]; }

  void clear() {
    many_.clear();
    size_ = 0;
  }
  void push_back(const T& item) {
    if (size_ == N) {
      const T copy = item;  // it may be one of ours
      many_.assign(few_.begin(), few_.end());
      many_.push_back(copy);
    } else if (is_long()) {
      many_.push_back(item);
    } else {
      few_[size_] = item;
    }
    ++size_;
  }
  template <typename Iterator>
  void assign(Iterator first, Iterator last) {
    clear();
    append(first, last);
  }
  template <typename Iterator>
  void append(Iterator first, Iterator last) {
    for (; first != last; ++first) push_back(*first);
  }
  /// Keeps the first ones.
  void shorten(std::size_t size) {
    if (is_long() && size <= N) {
      std::copy_n(many_.begin(), size, few_.begin());
      many_.clear();
    } else if (is_long()) {
      many_.resize(size);
    }
    size_ = size;
  }

  friend bool operator==(const SmallVector& a, const SmallVector& b) {
    return std::equal(a.begin(), a.end(), b.begin(), b.end());
  }

 private:
  bool is_long() const { return size_ > N; }

  std::size_t size_ = 0;
  std::array<T, N> few_{};
  std::vector<T> many_;
};

}  // namespace itr
