// SPDX-License-Identifier: MIT
// Writes the table of keys for readers outside: a JSON Schema, and the page docs/scenes.md.
#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "defaults.hpp"
#include "itr/scene.hpp"
#include "key_table.hpp"
#include "simulation/unsupported.hpp"

namespace itr::scene {

namespace {

/// ITR's default of a key; null where it is PolyFEM's.
const Default* find_default(const std::string& pointer) {
  for (const Default& row : itr_defaults())
    if (pointer == row.pointer) return &row;
  return nullptr;
}

void describe(const Entry& entry, Json& schema) {
  std::string text = entry.key->meaning;
  if (const std::string& unit = entry.key->unit; !unit.empty()) text += " [" + unit + "]";
  schema["description"] = text;
  if (!entry.fallback.is_discarded()) schema["default"] = entry.fallback;
  if (const Default* row = find_default(entry.key->pointer)) schema["default"] = Json::parse(row->value);
}

Json schema_of(const std::string& pattern);

Json object_schema(const std::string& pattern, const std::set<std::string>& children) {
  Json object = {{"type", "object"}, {"additionalProperties", false}, {"properties", Json::object()}};
  for (const auto& key : children) object["properties"][key] = schema_of(std::string(pattern).append("/").append(key));
  return object;
}

/// Schema of the values at a pattern: all that check_keys lets pass.
Json schema_of(const std::string& pattern) {
  const Entry* entry = key_table().find(pattern);
  const std::set<std::string>* children = key_table().children(pattern);
  Json schema = Json::object();
  if (entry && entry->key->role == Role::only) {
    schema["const"] = entry->fallback;
  } else if (entry && (entry->key->role == Role::refused || entry->key->role == Role::removed)) {
    schema["not"] = Json::object();
  } else if (entry && entry->key->role == Role::read && !children) {
    schema = entry->kind.schema;
  } else if (children && children->contains("*")) {
    const Json item = schema_of(pattern + "/*");
    schema["anyOf"] = {{{"type", "array"}, {"items", item}}, item};  // one that stands for a list of one
  } else if (children) {
    schema = object_schema(pattern, *children);
    if (entry && !entry->key->kind.empty()) schema = {{"anyOf", {schema, entry->kind.schema}}};
  }
  if (entry) describe(*entry, schema);
  return schema;
}

/// Parent of a row's pointer, without the key itself.
std::string parent_of(const std::string& pointer) {
  int depth = 0;
  for (std::size_t i = pointer.size(); i-- > 0;) {
    if (pointer[i] == '}') ++depth;
    if (pointer[i] == '{') --depth;
    if (pointer[i] == '/' && depth == 0) return pointer.substr(0, i);
  }
  return "";
}

std::string in_cell(const std::string& text) {
  std::string cell;
  for (const char c : text) {
    if (c == '|') cell += '\\';
    cell += c;
  }
  return cell;
}

std::string row(const Key& key) {
  const std::string &pointer = key.pointer, parent = parent_of(pointer);
  std::string names, fallback = key.fallback;
  for (const std::string& name : expand(pointer.substr(parent.size() + 1)))
    names += (names.empty() ? "`" : ", `") + name + "`";
  if (key.is_basic) names = "**" + names + "**";
  if (!fallback.empty() && fallback[0] != '(') fallback = "`" + fallback + "`";
  if (const Default* itr = find_default(pointer))
    fallback = fmt::format("`{}`; PolyFEM's: {}", itr->value, fallback.empty() ? "none" : fallback);
  return fmt::format("| {} | {} | {} | {} | {} |\n", names, in_cell(kind_of(key).words), in_cell(fallback), key.unit,
                     in_cell(key.meaning));
}

/// Tells whether a row is of a list's items, which the list's row describes.
bool is_item(const Key& key) { return key.pointer.ends_with("/*"); }

std::string tables_of_what_is_read() {
  std::vector<std::string> parents = {""};
  for (const Key& key : keys())
    if (const std::string parent = parent_of(key.pointer);
        key.role == Role::read && !is_item(key) && std::find(parents.begin(), parents.end(), parent) == parents.end())
      parents.push_back(parent);
  std::string text;
  for (const std::string& parent : parents) {
    text += "\n## `" + (parent.empty() ? "/" : parent) +
            "`\n\n| key | value | default | unit | meaning |\n|---|---|---|---|---|\n";
    for (const Key& key : keys())
      if (key.role == Role::read && parent_of(key.pointer) == parent && !is_item(key)) text += row(key);
  }
  return text;
}

/// Lists the keys of PolyFEM that do nothing here, those with the same reason together.
std::string list_of_ignored() {
  std::vector<std::pair<std::string, std::string>> reasons;
  for (const Key& key : keys()) {
    if (key.role != Role::ignored) continue;
    const auto has_reason = [&](const auto& one) { return one.first == key.meaning; };
    const auto at = std::find_if(reasons.begin(), reasons.end(), has_reason);
    const std::string pointer = "`" + key.pointer + "`";
    if (at == reasons.end())
      reasons.emplace_back(key.meaning, pointer);
    else
      at->second += ", " + pointer;
  }
  std::string text;
  for (const auto& [reason, pointers] : reasons) text += "- " + pointers + ": " + reason + "\n";
  return text;
}

std::string list_of_others(Role role) {
  std::string text;
  for (const Key& key : keys()) {
    if (key.role != role) continue;
    text += "- `" + key.pointer + "`";
    if (role == Role::only) text += " = `" + key.fallback + "`";
    text += ": " + key.meaning + "\n";
  }
  return text;
}

/// Makes GitHub's anchor of the section of a parent: letters, digits and underscores of its pointer.
std::string anchor_of(const std::string& parent) {
  std::string anchor;
  for (const char c : parent)
    if (std::isalnum(static_cast<unsigned char>(c)) || c == '_') anchor += static_cast<char>(std::tolower(c));
  return anchor;
}

/// Lists where a first scene begins: the names of the basic keys by section, without what the tables say of them.
std::string list_of_basic_keys() {
  std::string text =
      "\n## Basic keys\n\nA first scene has `geometry`, `materials` and `time`, and needs no other keys than these, "
      "bold in the tables:\n\n";
  std::string last;
  for (const Key& key : keys()) {
    if (!key.is_basic) continue;
    const std::string pointer = key.pointer, parent = parent_of(pointer), name = pointer.substr(parent.size() + 1);
    if (parent.empty()) continue;
    text += parent == last ? ", " : (last.empty() ? "- [`" : "\n- [`") + parent + "`](#" + anchor_of(parent) + "): ";
    text += "`" + name + "`";
    last = parent;
  }
  return text + "\n";
}

/// Lists where ITR's defaults are others than PolyFEM's, and why.
std::string section_of_defaults() {
  std::string text =
      "\n## Defaults\n\nThere are two sets. A scene that says nothing gets ITR's. `\"defaults\": \"polyfem\"`, or "
      "`itr run --defaults polyfem`, gives those of PolyFEM. `summary.json` and saved states name the set with its version, "
      "such as `itr-1`, and `--resume` keeps it. Runs of version 0.1 go on with `itr-0`: PolyFEM's set, but for "
      "`barrier_stiffness`, which is `\"auto\"`. `itr explain` prints what a scene gets. These keys have other defaults in "
      "ITR's set:\n\n| key | ITR | PolyFEM | why |\n|---|---|---|---|\n";
  for (const Default& row : itr_defaults()) {
    const Entry* entry = key_table().find(row.pointer);
    text += "| `" + std::string(row.pointer) + "` | `" + row.value + "` | `" + entry->key->fallback + "` | " + row.reason +
            " |\n";
  }
  return text;
}

/// Section of refusals: combinations, values, keys.
std::string section_of_refusals() {
  std::string text =
      "\n## Not there yet\n\nA scene that asks for one of these is refused with a message before anything is computed. "
      "Nothing is ignored silently.\n\n### Combinations\n\n";
  for (const auto& [place, words] : unsupported_combinations()) text += "- `" + std::string(place) + "`: " + words + "\n";
  text += "\n### Values\n\n";
  for (const Key& key : keys())
    if (!key.refused.empty()) text += "- `" + key.pointer + "`: " + key.refused + "\n";
  return text + "\n### Keys with one value\n\nAnother value than this one is an error.\n\n" + list_of_others(Role::only) +
         "\n### Keys\n\nTheir presence is an error.\n\n" + list_of_others(Role::refused);
}

constexpr const char* kIntroduction = R"(# Scenes: all keys

A scene is a JSON file in PolyFEM's format. This page is made by `itr schema --markdown` from the table of keys that the reader
checks scenes against. `itr schema` prints the same as JSON Schema, for editors. The [tutorial](tutorial.md) builds a first scene,
the [theory](theory.md) says what signs, dimensions, laws and tolerances mean, and the [examples](../examples/README.md) are
scenes to start from.

- `*` stands for the elements of a list. A list of one element may be written as that element alone.
- `{a,b}` stands for either.
- Units are those of SI. Where `/units` names others, they stand for the unit of the same kind: N/m^2 for MPa with mm, t, s
  ([units](theory.md#units)).
- A key that is not on this page is an error. The message names the nearest key that exists.
- An expression is a text of numbers, `x y z` (rest position), `t`, `pi`, `e`, `+ - * / % ^` and
  [functions](theory.md#expressions).

A file may build on another one. `"common": "base.json"` takes the keys of that file and merges the file's own keys over them:
objects key by key, lists as a whole, and `null` removes a key. Then `"patch"` is applied, a list of JSON Patch operations. Then
`--set /json/pointer=VALUE` acts. Paths are relative to `root_path`, by default the folder of the file that is run.

Jump to: [basic keys](#basic-keys), [defaults](#defaults), [not there yet](#not-there-yet), [not written](#not-written),
[without effect](#without-effect), [removed](#removed-in-02).
)";

}  // namespace

std::string json_schema() {
  Json schema = object_schema("", *key_table().children(""));
  schema["$schema"] = "http://json-schema.org/draft-07/schema#";
  schema["title"] = "Scene of ITR, after `common` and `patch` are merged";
  schema["required"] = {"geometry", "materials"};
  // Beside what the merged scene has, a file may say how it is merged.
  schema["properties"]["root_path"] = {{"type", "string"}, {"description", "what paths are relative to"}};
  schema["properties"]["common"] = {{"type", "string"}, {"description", "file that this one is merged over"}};
  schema["properties"]["patch"] = {{"type", "array"}, {"description", "JSON Patch, applied after merging"}};
  return schema.dump(2);
}

std::string reference_page() {
  return std::string(kIntroduction) + list_of_basic_keys() + section_of_defaults() + tables_of_what_is_read() +
         section_of_refusals() + "\n## Not written\n\nOutput of PolyFEM. A scene that asks for it gets a warning.\n\n" +
         list_of_others(Role::unwritten) + "\n## Without effect\n\nKnown to PolyFEM, and passed over here.\n\n" +
         list_of_ignored() + "\n## Removed in 0.2\n\nTheir presence is an error, which says what to set instead.\n\n" +
         list_of_others(Role::removed);
}

}  // namespace itr::scene
