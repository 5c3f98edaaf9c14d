// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <string_view>

namespace itr {

/// 'text', as messages tell what was found. Appended, because GCC 12 warns of "'" + std::string where it inlines that (its
/// bug 105651).
inline std::string quoted(std::string_view text) {
  std::string result(1, '\'');
  result += text;
  result += '\'';
  return result;
}
inline std::string quoted(char c) { return quoted(std::string_view(&c, 1)); }

}  // namespace itr
