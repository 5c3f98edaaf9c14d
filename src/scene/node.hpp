// SPDX-License-Identifier: MIT
// A place in a scene document: the JSON value there (or nothing), and the pointer that an error names.
#pragma once

#include <nlohmann/json.hpp>

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "itr/core.hpp"

namespace itr::scene {

using Json = nlohmann::json;

class Interpreters;
std::shared_ptr<Interpreters> make_interpreters();

/// A scene after merging: what all pointers point into.
struct Document {
  std::filesystem::path file;  ///< the outermost scene file
  std::filesystem::path root;  ///< effective root_path
  Json json;
  Units units{};                                                     ///< of its numbers
  std::vector<std::string> warnings{};                               ///< of where files of `common` were found
  std::shared_ptr<Interpreters> interpreters = make_interpreters();  ///< of the Python files that values name

  /// Absolute, else relative to `root`, else (if only there is such a file) to the working directory. Unlike in
  /// PolyFEM the root comes first: what a scene means must not depend on where the command is run.
  std::filesystem::path resolve(const std::string& path) const;
};

std::filesystem::path resolve_path(const std::filesystem::path& path, const std::filesystem::path& root,
                                   const std::filesystem::path& scene_file);
/// Warns of a path that is there from the working folder only.
void warn_of_working_folder(const std::string& place, const std::filesystem::path& path, const std::filesystem::path& root,
                            const std::filesystem::path& scene_file, std::vector<std::string>& warnings);

/// One reference token of a JSON pointer, escaped.
std::string escape_token(std::string_view token);
/// The JSON text of a value, cut to one short line.
std::string abbreviate(const Json& json);
/// "3, 5" or, where there are many, "0, 1, 2, 3, 4, ... (17 of them)".
std::string list_ids(const std::vector<int>& ids);
/// The candidate with the least edit distance; empty if none is close enough to be meant.
std::string nearest_name(std::string_view name, const std::vector<std::string>& candidates);

/// Finds among a few words the same but for case and signs, or one that contains the name, or the nearest.
std::string nearest_choice(std::string_view name, const std::vector<std::string>& choices);

class Node {
 public:
  explicit Node(const Document& document) : Node(document, &document.json, "") {}

  bool exists() const { return json_ != nullptr; }
  const Json& json() const { return *json_; }
  const std::string& pointer() const { return pointer_; }
  const Document& document() const { return *document_; }

  /// The member, absent if there is none or this is no object.
  Node operator[](std::string_view key) const;
  bool has(std::string_view key) const { return (*this)[key].exists(); }
  /// The element; this must be a list that is long enough.
  Node at(std::size_t index) const;
  /// The elements of a list; a single value that stands where a list is expected is a list of one; absent: none.
  std::vector<Node> items() const;

  /// The unit that the table of keys gives the value here, in SI's name; empty: none.
  std::string unit() const;
  /// Returns the node with numbers, its own and those below, taken as they stand.
  Node without_units() const;

  /// Values with a default for absent ones, in SI units. InputError if the type is another.
  double number(double fallback) const;
  int integer(int fallback) const;
  bool boolean(bool fallback) const;
  std::string string(std::string fallback) const;
  std::vector<double> numbers() const;
  /// Index into `names`; `fallback` if absent.
  int choice(const std::vector<std::string>& names, int fallback) const;

  double positive(double fallback) const;      ///< > 0
  double non_negative(double fallback) const;  ///< >= 0
  int integer_at_least(int least, int fallback) const;

  [[noreturn]] void fail(const std::string& expected) const;
  [[noreturn]] void fail(const std::string& found, const std::string& expected) const;

 private:
  Node(const Document& document, const Json* json, std::string pointer, bool has_units = true)
      : document_(&document), json_(json), pointer_(std::move(pointer)), has_units_(has_units) {}

  const Document* document_;
  const Json* json_;
  std::string pointer_;
  bool has_units_ = true;
};

/// Warns of the components of a list beyond `dimension`, and of missing ones; `if_not_zero`: a 0 beyond it is no mistake.
void warn_of_components(const Node& vector, int dimension, std::vector<std::string>& warnings, bool if_not_zero = false);

}  // namespace itr::scene
