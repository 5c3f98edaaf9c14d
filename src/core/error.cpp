// SPDX-License-Identifier: MIT
#include "itr/core.hpp"

#include <limits>

#include "core/check.hpp"
#include "core/count.hpp"

namespace itr {

namespace {
std::string describe(const InputError::Parts& parts) {
  std::string text;
  if (!parts.file.empty()) text += parts.file + ": ";
  if (!parts.place.empty()) text += parts.place + ": ";
  text += "found " + parts.found;
  if (!parts.expected.empty()) text += "; expected " + parts.expected;
  return text;
}
}  // namespace

InputError::InputError(Parts parts) : std::runtime_error(describe(parts)), parts_(std::move(parts)) {}

int as_index(std::size_t count, const char* what) {
  constexpr int kMost = std::numeric_limits<int>::max();
  if (count > static_cast<std::size_t>(kMost))
    throw InputError(
        {"", what, std::to_string(count), "at most " + std::to_string(kMost) + ", which indices of 32 bits reach"});
  return static_cast<int>(count);
}

namespace detail {
void check_failed(const char* condition, const char* file, int line, const std::string& values) {
  throw InternalError(std::string(file) + ":" + std::to_string(line) + ": broken invariant: " + condition +
                      (values.empty() ? "" : " with" + values));
}
}  // namespace detail

}  // namespace itr
