// SPDX-License-Identifier: MIT
// Places and sets, as messages to users name them.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "itr/core.hpp"
#include "itr/types.hpp"

namespace itr {

/// "(0.1, 0.2)" in the unit of length of `units`, of a position [m].
template <int Dim>
std::string point_text(const Vec<Dim>& p, const Units& units, int digits) {
  std::string text;
  for (int c = 0; c < Dim; ++c) text += fmt::format("{}{:.{}g}", c ? ", " : "(", units.from_si(p[c], "m"), digits);
  return text + ")";
}

/// The names that stand for an id, such as "\"root\""; the id where there are none.
inline std::string set_text(const std::map<std::string, std::vector<int>>& names, int id) {
  std::string text;
  for (const auto& [name, ids] : names)
    if (std::find(ids.begin(), ids.end(), id) != ids.end()) text += (text.empty() ? "\"" : " and \"") + name + "\"";
  return text.empty() ? std::to_string(id) : text;
}

}  // namespace itr
