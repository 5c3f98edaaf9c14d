// SPDX-License-Identifier: MIT
#include "node.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>
#include <numeric>

#include "key_table.hpp"

namespace itr::scene {

namespace fs = std::filesystem;

namespace {

std::string quoted_list(const std::vector<std::string>& names) {
  std::string text;
  for (const auto& name : names) text += (text.empty() ? "\"" : ", \"") + name + "\"";
  return text;
}

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i + 1;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] != b[j]);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, diagonal + 1});
    }
  }
  return row.back();
}

/// The path below the folder that relative paths start from.
fs::path below_folder(const fs::path& path, const fs::path& root, const fs::path& scene_file) {
  std::error_code ignored;
  // A root_path that names a folder of somebody else's computer: the scene's own folder is what was meant.
  const fs::path& base = fs::exists(root, ignored) ? root : scene_file;
  const fs::path folder = fs::is_directory(base, ignored) ? base : base.parent_path();
  return (folder / path).lexically_normal();
}

bool is_in_working_folder_only(const fs::path& path, const fs::path& below) {
  std::error_code ignored;
  return !fs::exists(below, ignored) && fs::exists(path, ignored);
}

}  // namespace

fs::path resolve_path(const fs::path& path, const fs::path& root, const fs::path& scene_file) {
  if (path.empty() || path.is_absolute()) return path;
  const fs::path below = below_folder(path, root, scene_file);
  return is_in_working_folder_only(path, below) ? path : below;
}

void warn_of_working_folder(const std::string& place, const fs::path& path, const fs::path& root, const fs::path& scene_file,
                            std::vector<std::string>& warnings) {
  if (path.empty() || path.is_absolute()) return;
  const fs::path below = below_folder(path, root, scene_file);
  if (!is_in_working_folder_only(path, below)) return;
  std::error_code ignored;
  warnings.push_back(place + ": there is no '" + below.string() + "'; taken from the working folder, '" +
                     (fs::current_path(ignored) / path).lexically_normal().string() + "'");
}

fs::path Document::resolve(const std::string& path) const { return resolve_path(path, root, file); }

std::string escape_token(std::string_view token) {
  std::string escaped;
  for (const char c : token) {
    if (c == '~')
      escaped += "~0";
    else if (c == '/')
      escaped += "~1";
    else
      escaped += c;
  }
  return escaped;
}

std::string abbreviate(const Json& json) {
  constexpr std::size_t kLongest = 80;
  // Invalid UTF-8 cannot come from a parsed file, but may come from an embedding program.
  std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  if (text.size() > kLongest) text = text.substr(0, kLongest) + "...";
  return text;
}

std::string list_ids(const std::vector<int>& ids) {
  constexpr std::size_t kMostNamed = 5;
  std::string text;
  for (std::size_t i = 0; i < std::min(ids.size(), kMostNamed); ++i) text += (i ? ", " : "") + std::to_string(ids[i]);
  return ids.size() > kMostNamed ? text + ", ... (" + std::to_string(ids.size()) + " of them)" : text;
}

std::string nearest_name(std::string_view name, const std::vector<std::string>& candidates) {
  std::string nearest;
  std::size_t least = std::max<std::size_t>(2, name.size() / 2) + 1;
  for (const auto& candidate : candidates) {
    const std::size_t distance = edit_distance(name, candidate);
    if (distance >= least) continue;
    least = distance;
    nearest = candidate;
  }
  return nearest;
}

std::string nearest_choice(std::string_view name, const std::vector<std::string>& choices) {
  const auto letters = [](std::string_view word) {
    std::string kept;
    for (const char c : word)
      if (std::isalnum(static_cast<unsigned char>(c)))
        kept += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return kept;
  };
  const std::string wanted = letters(name);
  for (const std::string& choice : choices)
    if (const std::string known = letters(choice); !wanted.empty() && known == wanted) return choice;
  for (const std::string& choice : choices)
    if (wanted.size() >= 4 && letters(choice).find(wanted) != std::string::npos) return choice;
  return wanted.size() < 3 ? "" : nearest_name(name, choices);  // all are near to shorter ones
}

Node Node::operator[](std::string_view key) const {
  const Json* member = nullptr;
  if (json_ && json_->is_object()) {
    const auto found = json_->find(std::string(key));
    if (found != json_->end() && !found->is_null()) member = &*found;
  }
  return Node(*document_, member, pointer_ + "/" + escape_token(key), has_units_);
}

Node Node::at(std::size_t index) const {
  return Node(*document_, &json_->at(index), pointer_ + "/" + std::to_string(index), has_units_);
}

std::vector<Node> Node::items() const {
  std::vector<Node> nodes;
  if (!json_) return nodes;
  if (!json_->is_array()) return {*this};
  for (std::size_t i = 0; i < json_->size(); ++i) nodes.push_back(at(i));
  return nodes;
}

std::string Node::unit() const {
  const Entry* entry = has_units_ ? key_table().find_place(pointer_) : nullptr;
  return entry ? entry->key->unit : "";
}

Node Node::without_units() const { return Node(*document_, json_, pointer_, false); }

double Node::number(double fallback) const {
  if (!json_) return fallback;
  if (!json_->is_number() || !std::isfinite(json_->get<double>())) fail("a number");
  const double value = json_->get<double>();
  return document_->units.is_si() ? value : document_->units.to_si(value, unit());
}

int Node::integer(int fallback) const {
  if (!json_) return fallback;
  const double value = json_->is_number() ? json_->get<double>() : 0.5;
  if (value != std::floor(value) || std::abs(value) > std::numeric_limits<int>::max()) fail("an integer");
  return static_cast<int>(value);
}

bool Node::boolean(bool fallback) const {
  if (!json_) return fallback;
  if (!json_->is_boolean()) fail("true or false");
  return json_->get<bool>();
}

std::string Node::string(std::string fallback) const {
  if (!json_) return fallback;
  if (!json_->is_string()) fail("a string");
  return json_->get<std::string>();
}

std::vector<double> Node::numbers() const {
  std::vector<double> values;
  if (!json_) return values;
  if (!json_->is_array()) fail("a list of numbers");
  for (const Node& item : items()) values.push_back(item.number(0));
  return values;
}

int Node::choice(const std::vector<std::string>& names, int fallback) const {
  if (!json_) return fallback;
  const std::string name = json_->is_string() ? json_->get<std::string>() : "";
  const auto found = std::find(names.begin(), names.end(), name);
  if (!json_->is_string() || found == names.end()) {
    const std::string near = nearest_choice(name, names);
    fail((near.empty() ? "" : "\"" + near + "\" perhaps; ") + ("one of " + quoted_list(names)));
  }
  return static_cast<int>(found - names.begin());
}

double Node::positive(double fallback) const {
  const double value = number(fallback);
  if (!(value > 0)) fail("a number > 0");
  return value;
}

double Node::non_negative(double fallback) const {
  const double value = number(fallback);
  if (!(value >= 0)) fail("a number >= 0");
  return value;
}

int Node::integer_at_least(int least, int fallback) const {
  const int value = integer(fallback);
  if (value < least) fail("an integer >= " + std::to_string(least));
  return value;
}

void Node::fail(const std::string& expected) const { fail(json_ ? abbreviate(*json_) : "nothing", expected); }

void Node::fail(const std::string& found, const std::string& expected) const {
  throw InputError({document_->file.string(), pointer_.empty() ? "/" : pointer_, found, expected});
}

void warn_of_components(const Node& vector, int dimension, std::vector<std::string>& warnings, bool if_not_zero) {
  if (!vector.exists() || !vector.json().is_array() || vector.json().empty()) return;
  const Json& values = vector.json();
  const std::string scene = std::to_string(dimension) + "D scene";
  if (values.size() < static_cast<std::size_t>(dimension))
    warnings.push_back(vector.pointer() + ": " + abbreviate(values) + " has too few components for a " + scene +
                       ": the others are 0");
  for (std::size_t c = dimension; c < values.size(); ++c)
    if (!if_not_zero || values[c] != 0) {
      warnings.push_back(vector.pointer() + ": " + abbreviate(values) + " has more components than a " + scene + " has, " +
                         std::to_string(dimension) + ": the others are passed over");
      return;
    }
}

}  // namespace itr::scene
