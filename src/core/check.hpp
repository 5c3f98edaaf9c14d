// SPDX-License-Identifier: MIT
// Checks of our own invariants. ITR_CHECK is always on and meant for cheap conditions; ITR_AUDIT is compiled in only with
// the `audit` preset (ITR_ENABLE_AUDIT) and may cost as much as it likes.
#pragma once

#include <sstream>
#include <string>

namespace itr::detail {

[[noreturn]] void check_failed(const char* condition, const char* file, int line, const std::string& values);

template <typename... Values>
std::string join(const Values&... values) {
  std::ostringstream out;
  ((out << ' ' << values), ...);
  return out.str();
}

}  // namespace itr::detail

#define ITR_CHECK(condition, ...)                                                                    \
  do {                                                                                               \
    if (!(condition)) [[unlikely]]                                                                   \
      ::itr::detail::check_failed(#condition, __FILE__, __LINE__, ::itr::detail::join(__VA_ARGS__)); \
  } while (false)

#ifdef ITR_ENABLE_AUDIT
#define ITR_AUDIT(...) ITR_CHECK(__VA_ARGS__)
#else
#define ITR_AUDIT(...) \
  do {                 \
  } while (false)
#endif
