// SPDX-License-Identifier: MIT
#include "key_table.hpp"

#include <algorithm>
#include <sstream>

#include "core/check.hpp"

namespace itr::scene {

namespace {

Json scalar_schema() { return {{"type", {"number", "string"}}}; }
Json list_of(const Json& item) { return {{"type", "array"}, {"items", item}}; }
Json any_of(const Json& a, const Json& b) { return {{"anyOf", {a, b}}}; }
Json number_schema() { return {{"type", "number"}}; }
Json natural_schema() { return {{"type", "integer"}, {"minimum", 0}}; }
/// A number or a name.
Json id_schema() { return any_of(natural_schema(), {{"type", "string"}}); }

void check_names(const Node& node) {
  for (const Node& name : node.items()) name.string("");
}

void check_distance(const Node& node) {
  if (node.json() == "auto") return;
  if (!node.json().is_number()) node.fail("a number > 0, or \"auto\"");
  node.positive(1);
}

void check_stiffness(const Node& node) {
  if (node.json() == "adaptive" || node.json() == "auto") return;
  if (!node.json().is_number()) node.fail("a number > 0, \"auto\" or \"adaptive\"");
  node.positive(1);
}

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> kinds = {
      {"number", [](const Node& node) { node.number(0); }, number_schema(), "number"},
      {"positive", [](const Node& node) { node.positive(1); }, {{"type", "number"}, {"exclusiveMinimum", 0}}, "number > 0"},
      {"non_negative", [](const Node& node) { node.non_negative(0); }, {{"type", "number"}, {"minimum", 0}}, "number >= 0"},
      {"share", nullptr, {{"type", "number"}, {"minimum", 0}, {"maximum", 1}}, "number of [0, 1]"},
      {"integer", [](const Node& node) { node.integer(0); }, {{"type", "integer"}}, "integer"},
      {"natural", [](const Node& node) { node.integer_at_least(0, 0); }, natural_schema(), "integer >= 0"},
      {"count",
       [](const Node& node) { node.integer_at_least(1, 1); },
       {{"type", "integer"}, {"minimum", 1}},
       "integer >= 1"},
      {"boolean", [](const Node& node) { node.boolean(false); }, {{"type", "boolean"}}, "boolean"},
      {"string", [](const Node& node) { node.string(""); }, {{"type", "string"}}, "string"},
      {"path", [](const Node& node) { node.string(""); }, {{"type", "string"}}, "path"},
      {"names", check_names, any_of({{"type", "string"}}, list_of({{"type", "string"}})), "name or list of names"},
      {"number or expression", nullptr, scalar_schema(), "number or expression"},
      {"vector", nullptr, list_of(scalar_schema()), "list of numbers or expressions, one a component"},
      {"number or numbers", nullptr, any_of(number_schema(), list_of(number_schema())), "number or list of numbers"},
      {"numbers", nullptr, list_of(number_schema()), "list of numbers"},
      {"booleans", nullptr, list_of({{"type", "boolean"}}), "list of booleans"},
      {"counts", nullptr, any_of(natural_schema(), list_of(natural_schema())), "list of integers >= 1, one an axis"},
      {"points", nullptr, list_of(list_of(number_schema())), "two lists of numbers"},
      {"axis", nullptr, {{"type", {"integer", "string"}}}, "integer or string"},
      {"id", nullptr, id_schema(), "integer >= 0 or name"},
      {"id or ids", nullptr, any_of(id_schema(), list_of(id_schema())), "integer, name or list of these"},
      {"id or all", nullptr, id_schema(), "integer, name or \"all\""},
      {"positive, auto or adaptive", check_stiffness,
       any_of({{"type", "number"}, {"exclusiveMinimum", 0}}, {{"enum", {"auto", "adaptive"}}}),
       "number > 0, \"auto\" or \"adaptive\""},
      {"positive or auto", check_distance, any_of({{"type", "number"}, {"exclusiveMinimum", 0}}, {{"const", "auto"}}),
       "number > 0 or \"auto\""},
      {"consistent", [](const Node& node) { node.choice({"consistent"}, 0); }, {{"const", "consistent"}}, "\"consistent\""},
      {"order", nullptr, any_of({{"enum", {1, 2}}}, {{"type", {"array", "object"}}}), "1, 2 or a list"},
      {"list", nullptr, Json::object(), "list"},  // of what its rows with `*` say
      {"object", nullptr, {{"type", "object"}}, "object"},
      {"", nullptr, Json::object(), "object"}};
  return kinds;
}

}  // namespace

const std::vector<Key>& keys() {
  static const std::vector<Key> all = [] {
    const std::map<std::string, Role> roles = {
        {"", Role::read},     {"ignored", Role::ignored}, {"unwritten", Role::unwritten},
        {"only", Role::only}, {"refused", Role::refused}, {"removed", Role::removed}};
    std::vector<Key> rows;
    for (const Json& row : Json::parse(kKeys)) {
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
    const auto found = std::find_if(kinds().begin(), kinds().end(), [&](const Kind& kind) { return name == kind.name; });
    ITR_CHECK(found != kinds().end(), key.pointer, name);
    return *found;
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
    if (entry.key->role != Role::removed && pattern.ends_with("/" + key)) return pattern;
  return "";
}

const KeyTable& key_table() {
  static const KeyTable table;
  return table;
}

}  // namespace itr::scene
