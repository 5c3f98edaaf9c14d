// SPDX-License-Identifier: MIT
#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <iterator>
#include <string_view>
#include <utility>

#include "expression.hpp"
#include "key_table.hpp"
#include "readers.hpp"

namespace itr::scene {

namespace {

/// Names that other programs use, and where a scene says the same.
constexpr std::pair<std::string_view, std::string_view> kOtherNames[] = {
    {"density", "\"rho\""},
    {"young", "\"E\""},
    {"youngs_modulus", "\"E\""},
    {"poisson", "\"nu\""},
    {"poisson_ratio", "\"nu\""},
    {"poissons_ratio", "\"nu\""},
    {"friction", "/contact/friction_coefficient"},
    {"gravity", "/boundary_conditions/rhs, which pushes in the negative direction,"},
};

constexpr std::size_t kTelling = 4;  ///< letters of a key, at least, that others are compared with by parts

/// The shortest of the names that contain the key, as time_steps does for steps.
std::string longer_name(const std::string& key, const std::vector<std::string>& names) {
  std::string found;
  for (const std::string& name : names)
    if (key.size() >= kTelling && name.find(key) != name.npos && (found.empty() || name.size() < found.size())) found = name;
  return found;
}

/// The name whose meaning has the key as a word, as that of scalar_values has von_mises.
std::string name_by_meaning(const std::string& key, const std::string& pattern, const std::vector<std::string>& names) {
  const auto is_letter = [](char c) { return std::isalnum(static_cast<unsigned char>(c)) || c == '_'; };
  if (key.size() < kTelling) return "";
  for (const std::string& name : names) {
    const Entry* entry = key_table().find(std::string(pattern).append("/").append(name));
    if (!entry) continue;
    const std::string_view meaning = entry->key->meaning;
    for (std::size_t at = meaning.find(key); at != meaning.npos; at = meaning.find(key, at + 1))
      if (const std::size_t end = at + key.size();
          (at == 0 || !is_letter(meaning[at - 1])) && (end == meaning.size() || !is_letter(meaning[end])))
        return name;
  }
  return "";
}

[[noreturn]] void refuse_unknown(const Node& parent, const std::string& key, const std::string& pattern) {
  const std::vector<std::string> names = key_table().names_below(pattern);
  std::string expected;
  const auto other =
      std::find_if(std::begin(kOtherNames), std::end(kOtherNames), [&](const auto& o) { return o.first == key; });
  if (other != std::end(kOtherNames))
    expected = std::string(other->second) + " perhaps; ";
  else if (const std::string near = nearest_name(key, names), below = key_table().place_of(key);
           !near.empty() && (near.find(key) != near.npos || !below.starts_with(pattern + "/")))
    expected = "\"" + near + "\" perhaps; ";
  else if (const std::string longer = longer_name(key, names); !longer.empty())
    expected = "\"" + longer + "\" perhaps; ";
  else if (const std::string place = key_table().place_of(key); !place.empty())
    expected = "it at " + place + " perhaps; ";
  else if (const std::string name = name_by_meaning(key, pattern, names); !name.empty())
    expected = "\"" + name + "\" perhaps; ";
  expected += "known here:";
  for (const auto& name : names) expected += " " + name;
  parent[key].fail("an unknown key", expected);
}

class Checker {
 public:
  explicit Checker(std::vector<std::string>& warnings) : warnings_(warnings) {}

  void check(const Node& node, const std::string& pattern) {
    const Entry* entry = key_table().find(pattern);
    if (entry && entry->key->role != Role::read) return check_unread(node, *entry);
    const std::set<std::string>* children = key_table().children(pattern);
    if (children && children->contains("*")) return check_items(node, pattern);
    if (entry && (!children || (!entry->key->kind.empty() && !node.json().is_object()))) return check_value(node, *entry);
    if (!node.json().is_object()) node.fail("an object");
    for (const auto& [key, value] : node.json().items()) {
      if (!children->contains(key)) refuse_unknown(node, key, pattern);
      check(node[key], std::string(pattern).append("/").append(key));
    }
  }

 private:
  /// One that stands where a list is expected is a list of one.
  void check_items(const Node& node, const std::string& pattern) {
    for (const Node& item : node.items()) check(item, pattern + "/*");
  }

  void check_value(const Node& node, const Entry& entry) {
    warn_of_degrees(node, node.json());
    if (entry.kind.check) return entry.kind.check(node);
    if (!entry.kind.choices.empty()) node.choice(entry.kind.choices, 0);
  }

  void warn_of_degrees(const Node& node, const nlohmann::json& value) {
    if (value.is_array())
      for (const auto& item : value) warn_of_degrees(node, item);
    if (!value.is_string()) return;
    try {
      const Expression expression(value.get<std::string>());
      for (const std::string& call : expression.large_angles())
        warnings_.push_back(node.pointer() + ": " + call +
                            " is of radians, of more than a full turn; deg2rad() takes degrees");
    } catch (const ExpressionError&) {  // who reads it says so
    }
  }

  void check_unread(const Node& node, const Entry& entry) {
    switch (entry.key->role) {
      case Role::refused:
        node.fail(abbreviate(node.json()), "no such key: it is not supported yet");
      case Role::only:
        if (node.json() != entry.fallback)
          node.fail(fmt::format("{}: others are not supported{}", abbreviate(entry.fallback),
                                entry.key->meaning.empty() ? "" : fmt::format(" ({})", entry.key->meaning)));
        return;
      case Role::removed:
        node.fail("a key that was removed in version 0.2", entry.key->meaning);
      case Role::unwritten:
        if (node.json() != entry.fallback) warnings_.push_back(node.pointer() + ": is not written");
        return;
      default:
        return;
    }
  }

  std::vector<std::string>& warnings_;
};

}  // namespace

void check_keys(const Document& document, std::vector<std::string>& warnings) {
  Checker(warnings).check(Node(document), "");
}

}  // namespace itr::scene
