// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>

namespace itr {

/// A copy of an array with its elements ascending: the key of a simplex, whatever its orientation.
template <typename Array>
Array sorted(Array array) {
  std::sort(array.begin(), array.end());
  return array;
}

}  // namespace itr
