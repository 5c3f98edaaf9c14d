// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>
#include <optional>
#include <string_view>
#include <utility>

namespace itr::backends {

/// What a library calls an ordering, by our name for it.
using Ordering = std::pair<std::string_view, int>;

/// The library's number for the option ordering=NAME; none for another option or name.
template <std::size_t N>
std::optional<int> find_ordering(const Ordering (&table)[N], std::string_view key, std::string_view value) {
  if (key != "ordering") return {};
  for (const auto& [name, number] : table)
    if (name == value) return number;
  return {};
}

}  // namespace itr::backends
