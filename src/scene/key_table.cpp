// SPDX-License-Identifier: MIT
#include "key_table.hpp"

#include <algorithm>
#include <sstream>

#include "core/check.hpp"

namespace itr::scene {

namespace {

const Json& table() {
  static const Json json = Json::parse(kKeys);
  return json;
}

/// Checks numbers > 0 where the node has none of some words.
void check_positive_unless(const Node& node, const std::vector<const char*>& words, const char* expected) {
  if (std::any_of(words.begin(), words.end(), [&](const char* word) { return node.json() == word; })) return;
  if (!node.json().is_number()) node.fail(expected);
  node.positive(1);
}

constexpr double kMostAccuracy = 0.5;

/// Checks of kinds whose values their readers do not check.
const std::map<std::string, void (*)(const Node&)> kChecks = {
    {"number", [](const Node& node) { node.number(0); }},
    {"positive", [](const Node& node) { node.positive(1); }},
    {"non_negative", [](const Node& node) { node.non_negative(0); }},
    {"integer", [](const Node& node) { node.integer(0); }},
    {"natural", [](const Node& node) { node.integer_at_least(0, 0); }},
    {"count", [](const Node& node) { node.integer_at_least(1, 1); }},
    {"boolean", [](const Node& node) { node.boolean(false); }},
    {"string", [](const Node& node) { node.string(""); }},
    {"path", [](const Node& node) { node.string(""); }},
    {"names",
     [](const Node& node) {
       for (const Node& name : node.items()) name.string("");
     }},
    {"consistent", [](const Node& node) { node.choice({"consistent"}, 0); }},
    {"positive or auto", [](const Node& node) { check_positive_unless(node, {"auto"}, "a number > 0, or \"auto\""); }},
    {"boolean or auto",
     [](const Node& node) {
       if (node.json() != "auto") node.boolean(false);
     }},
    {"accuracy",
     [](const Node& node) {
       if (!node.json().is_number()) node.fail("a number of (0, 0.5], or an object with value");
       if (node.positive(1) > kMostAccuracy) node.fail("a number of (0, 0.5]");
     }},
    {"positive, auto or adaptive", [](const Node& node) {
       check_positive_unless(node, {"auto", "adaptive"}, "a number > 0, \"auto\" or \"adaptive\"");
     }}};

}  // namespace

const std::vector<Key>& keys() {
  static const std::vector<Key> all = [] {
    const std::map<std::string, Role> roles = {
        {"", Role::read},     {"ignored", Role::ignored}, {"unwritten", Role::unwritten},
        {"only", Role::only}, {"refused", Role::refused}, {"removed", Role::removed}};
    std::vector<Key> rows;
    for (const Json& row : table()["keys"]) {
      const auto text = [&](const char* name) { return row.value(name, ""); };
      rows.push_back({text("keys"), roles.at(text("role")), text("kind"), text("default"), text("unit"), text("meaning"),
                      row.value("basic", false), text("refused")});
    }
    return rows;
  }();
  return all;
}

std::vector<std::string> expand(const std::string& pointer) {
  const auto open = pointer.find('{');
  if (open == std::string::npos) return {pointer};
  const auto close = pointer.find('}', open);
  std::istringstream names(pointer.substr(open + 1, close - open - 1));
  std::vector<std::string> patterns;
  for (std::string name; std::getline(names, name, ',');)
    for (const std::string& rest : expand(pointer.substr(close + 1)))
      patterns.push_back(pointer.substr(0, open) + name + rest);
  return patterns;
}

Kind kind_of(const Key& key) {
  const std::string& name = key.kind;
  if (name.find('|') == std::string::npos) {
    const Json& kinds = table()["kinds"];
    const auto found = std::find_if(kinds.begin(), kinds.end(), [&](const Json& kind) { return kind["kind"] == name; });
    ITR_CHECK(found != kinds.end(), key.pointer, name);
    const auto check = kChecks.find(name);
    return {name, check == kChecks.end() ? nullptr : check->second, (*found)["schema"], (*found)["words"]};
  }
  Kind kind{name, nullptr, {}, ""};
  std::istringstream words(name);
  for (std::string word; std::getline(words, word, '|');) {
    kind.choices.push_back(word);
    kind.words += (kind.words.empty() ? "" : ", ") + (word.empty() ? "\"\"" : word);
  }
  kind.schema = {{"enum", kind.choices}};
  return kind;
}

KeyTable::KeyTable() {
  for (const Key& key : keys()) {
    const Entry entry{&key, kind_of(key), Json::parse(key.fallback.starts_with('(') ? "" : key.fallback, nullptr, false)};
    for (const std::string& pattern : expand(key.pointer)) {
      ITR_CHECK(entries_.emplace(pattern, entry).second, "two rows for", pattern);
      for (std::string child = pattern; !child.empty();) {
        const auto slash = child.rfind('/');
        children_[child.substr(0, slash)].insert(child.substr(slash + 1));
        child.resize(slash);
      }
    }
  }
}

const Entry* KeyTable::find(const std::string& pattern) const {
  const auto found = entries_.find(pattern);
  return found == entries_.end() ? nullptr : &found->second;
}

const Entry* KeyTable::find_place(const std::string& pointer) const {
  std::string pattern;
  std::istringstream tokens(pointer.empty() ? "" : pointer.substr(1));
  for (std::string token; std::getline(tokens, token, '/');) {
    const std::set<std::string>* below = children(pattern);
    if (below && below->contains("*")) {
      pattern += "/*";
      if (token.find_first_not_of("0123456789") == std::string::npos) continue;
      below = children(pattern);  // one that stands for a list of one
    }
    if (!below || !below->contains(token)) break;
    pattern += "/" + token;
  }
  return find(pattern);
}

const std::set<std::string>* KeyTable::children(const std::string& pattern) const {
  const auto found = children_.find(pattern);
  return found == children_.end() ? nullptr : &found->second;
}

std::vector<std::string> KeyTable::names_below(const std::string& pattern) const {
  std::vector<std::string> names;
  for (const std::string& name : children_.at(pattern)) {
    const Entry* entry = find(std::string(pattern).append("/").append(name));
    if (!entry || entry->key->role != Role::removed) names.push_back(name);
  }
  return names;
}

std::string KeyTable::place_of(const std::string& key) const {
  for (const auto& [pattern, entry] : entries_)
    if (entry.key->role != Role::removed && entry.key->role != Role::ignored && pattern.ends_with("/" + key)) return pattern;
  for (const auto& [pattern, names] : children_)
    if (pattern.ends_with("/" + key)) return pattern;
  return "";
}

const KeyTable& key_table() {
  static const KeyTable table;
  return table;
}

}  // namespace itr::scene
