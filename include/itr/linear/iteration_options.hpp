// SPDX-License-Identifier: MIT
// The options that iterative solvers share, in the library and in modules (C++17).
#pragma once

#include <charconv>
#include <string_view>
#include <system_error>

namespace itr::linear {

struct IterationOptions {
  static constexpr const char* kNames = "tolerance=NUMBER max_iterations=NUMBER";

  double tolerance = 1e-10;  ///< relative residual at which to stop
  int max_iterations = 0;    ///< 0: the solver's own choice

  /// False where there is no such option, or not with that value.
  bool set(std::string_view key, std::string_view value) {
    double number = 0;
    const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
    if (error != std::errc() || end != value.data() + value.size()) return false;
    if (key == "tolerance" && number > 0 && number < 1)
      tolerance = number;
    else if (key == "max_iterations" && number >= 1 && number < 1e9)
      max_iterations = static_cast<int>(number);
    else
      return false;
    return true;
  }
};

}  // namespace itr::linear
