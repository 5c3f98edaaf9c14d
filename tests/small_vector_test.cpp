// SPDX-License-Identifier: MIT
#include "core/small_vector.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace itr {
namespace {

TEST(SmallVector, HoldsWhatAVectorHolds) {
  std::mt19937 random(1);
  for (int round = 0; round < 200; ++round) {
    SmallVector<int, 4> list;
    std::vector<int> expected;
    for (int i = 0; i < 12; ++i) {
      const int value = static_cast<int>(random() % 100);
      if (const auto what = random() % 6; what == 0) {
        const std::size_t size = random() % (expected.size() + 1);
        list.shorten(size);
        expected.resize(size);
      } else if (what == 1 && !expected.empty()) {
        list.push_back(list.front());  // its own
        expected.push_back(expected[0]);
      } else if (what == 2 && round % 3 == 0) {
        list.clear();
        expected.clear();
      } else {
        list.push_back(value);
        expected.push_back(value);
      }
      const SmallVector<int, 4> copy(list);
      ASSERT_TRUE(std::equal(list.begin(), list.end(), expected.begin(), expected.end()));
      ASSERT_TRUE(copy == list);
      ASSERT_EQ(list.size(), expected.size());
      ASSERT_EQ(list.empty(), expected.empty());
      ASSERT_TRUE(expected.empty() || list.back() == expected.back());
    }
    const SmallVector<int, 4> other(expected);
    ASSERT_TRUE(other == list);
  }
}

}  // namespace
}  // namespace itr
