// SPDX-License-Identifier: MIT
#include "itr/core/error.hpp"

#include "itr/core/check.hpp"

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

namespace detail {
void check_failed(const char* condition, const char* file, int line, const std::string& values) {
  throw InternalError(std::string(file) + ":" + std::to_string(line) + ": broken invariant: " + condition +
                      (values.empty() ? "" : " with" + values));
}
}  // namespace detail

}  // namespace itr
