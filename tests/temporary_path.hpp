// SPDX-License-Identifier: MIT
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string>

namespace itr {

/// Path for files of this test alone, also where another build runs the same test at the same time.
inline std::filesystem::path temporary_path(const std::string& name = {}) {
  const auto* test = testing::UnitTest::GetInstance()->current_test_info();
  std::string test_name = test->name();
  for (char& c : test_name)
    if (c == '/') c = '_';
  return std::filesystem::path(testing::TempDir()) / ("itr_" + test_name + "_" + std::to_string(::getpid()) + name);
}

}  // namespace itr
