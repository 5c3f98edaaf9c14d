// SPDX-License-Identifier: MIT
// Arrays of programs, and checks of what they hand in: errors name the array, the index, what was found and what was
// expected.
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "itr/core.hpp"
#include "itr/types.hpp"

namespace itr {

[[noreturn]] inline void refuse(const std::string& place, const std::string& found, const std::string& expected) {
  throw InputError({"", place, found, expected});
}

inline void check_finite(const std::string& name, std::span<const double> values) {
  for (std::size_t i = 0; i < values.size(); ++i)
    if (!std::isfinite(values[i])) refuse(fmt::format("{}[{}]", name, i), fmt::format("{}", values[i]), "a finite number");
}

inline void check_array(const std::string& name, std::span<const double> values, std::size_t length) {
  if (values.size() != length) refuse(name, fmt::format("{} numbers", values.size()), std::to_string(length));
  check_finite(name, values);
}

inline void check_multiple(const std::string& name, std::size_t length, int multiple) {
  if (length % static_cast<std::size_t>(multiple) != 0)
    refuse(name, fmt::format("{} numbers", length), fmt::format("a multiple of {}", multiple));
}

/// Ids of `count` vertices.
inline void check_ids(const std::string& name, std::span<const int> ids, std::size_t count) {
  for (std::size_t i = 0; i < ids.size(); ++i)
    if (ids[i] < 0 || static_cast<std::size_t>(ids[i]) >= count)
      refuse(fmt::format("{}[{}]", name, i), std::to_string(ids[i]), fmt::format("a vertex, 0 to {} - 1", count));
}

/// A block that a program gives for some of `count` vertices, column-major.
inline void check_block(const std::string& name, std::span<const int> vertices, std::span<const double> block,
                        std::size_t count) {
  check_ids(name + ".vertices", vertices, count);
  check_finite(name + ".block", block);
}

/// Joins row(0), row(1), ... one after the other.
template <typename Row>
std::vector<int> joined(int count, const Row& row) {
  std::vector<int> ids;
  for (int i = 0; i < count; ++i) ids.insert(ids.end(), row(i).begin(), row(i).end());
  return ids;
}
template <typename Value>
std::vector<int> listed(int count, const Value& value) {
  std::vector<int> values;
  for (int i = 0; i < count; ++i) values.push_back(value(i));
  return values;
}

inline VectorX as_field(std::span<const double> values) {
  return Eigen::Map<const VectorX>(values.data(), static_cast<Eigen::Index>(values.size()));
}

}  // namespace itr
