// SPDX-License-Identifier: MIT
// The table of all keys of a scene: what the reader checks against, what the schema and the page docs/scenes.md are made of.
#pragma once

#include <map>
#include <set>
#include <string>
#include <vector>

#include "node.hpp"

namespace itr::scene {

enum class Role {
  read,       ///< honoured
  ignored,    ///< speed, or how PolyFEM gets to a result that does not depend on it; with all that is below
  unwritten,  ///< output that PolyFEM has and we do not: a warning where it is asked for
  only,       ///< supported with one value, its default
  refused,    ///< changes results, not built
  removed     ///< was read before; its meaning is what to set instead
};

/// A row of keys.json. New keys come with their reader and a test; after that `itr schema --markdown > docs/scenes.md`.
struct Key {
  std::string pointer;  ///< `keys`: `*` stands for the elements of a list, `{a,b}` for either
  Role role = Role::read;
  std::string kind;       ///< of its values: the name of a Kind, or "a|b|c" for one of these words; empty: an object
  std::string fallback;   ///< `default`: text of its JSON, or words in parentheses; empty: none
  std::string unit;       ///< SI's name of it, as Units takes it; empty: none, or not the same for all
  std::string meaning;    ///< of a key that is not read: why, or what to set instead
  bool is_basic = false;  ///< a first scene of one's own needs it
  std::string refused;    ///< values that are known and refused
};
/// The rows in the order of the page.
const std::vector<Key>& keys();
extern const char* const kKeys;  ///< text of keys.json: rows of kinds and of keys

/// Kind of a value, as the reader checks it and as the schema says it.
struct Kind {
  std::string name;
  void (*check)(const Node&);  ///< null: its reader does
  Json schema;
  std::string words;                   ///< for the page
  std::vector<std::string> choices{};  ///< the words that are allowed, if only some are
};

/// A pattern without braces.
struct Entry {
  const Key* key = nullptr;
  Kind kind;
  Json fallback;  ///< discarded where it is none or words
};

class KeyTable {
 public:
  KeyTable();
  /// Null where there is no such pattern.
  const Entry* find(const std::string& pattern) const;
  /// Finds the entry of the value that a pointer of a scene names, or of the list that it is in; null where there is no such
  /// key.
  const Entry* find_place(const std::string& pointer) const;
  /// Keys that may stand below a pattern, removed ones too, or null if none may.
  const std::set<std::string>* children(const std::string& pattern) const;
  /// Lists the keys that may stand below a pattern and are not removed.
  std::vector<std::string> names_below(const std::string& pattern) const;
  /// A pointer elsewhere in the scene with this key, or nothing.
  std::string place_of(const std::string& key) const;

 private:
  std::map<std::string, Entry> entries_;
  std::map<std::string, std::set<std::string>> children_;
};
const KeyTable& key_table();

/// The patterns of a row: braces expanded.
std::vector<std::string> expand(const std::string& pointer);
Kind kind_of(const Key& key);

}  // namespace itr::scene
