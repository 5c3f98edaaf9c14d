// SPDX-License-Identifier: MIT
#include <algorithm>
#include <set>
#include <utility>

#include "core/read_file.hpp"
#include "readers.hpp"

namespace itr::scene {

namespace fs = std::filesystem;

namespace {

std::string read_text(const fs::path& file, const std::string& asking_file, const std::string& place) {
  std::optional<std::string> text = read_file(file);
  if (!text) throw InputError({asking_file, place, "no readable file '" + file.string() + "'", "a scene file"});
  return *std::move(text);
}

/// Follows a parser, and refuses a key that an object has twice: only one of the two values would count.
class ParsedPlace {
 public:
  explicit ParsedPlace(std::string file) : file_(std::move(file)) {}

  bool note(Json::parse_event_t event, const Json& parsed) {
    using Event = Json::parse_event_t;
    if (event == Event::object_start || event == Event::array_start) {
      levels_.push_back({event == Event::array_start});
      return true;
    }
    if (event == Event::key) {
      levels_.back().key = escape_token(parsed.get<std::string>());
      if (!levels_.back().keys.insert(levels_.back().key).second)
        throw InputError({file_, pointer(), "the key twice", "it once: one value would be lost"});
      return true;
    }
    if (event != Event::value) levels_.pop_back();
    if (!levels_.empty()) ++levels_.back().index;
    return true;
  }

  std::string pointer() const {
    std::string pointer;
    for (const Level& level : levels_) pointer += "/" + (level.is_list ? std::to_string(level.index) : level.key);
    return pointer.empty() ? "/" : pointer;
  }

 private:
  struct Level {
    bool is_list;
    std::size_t index = 0;
    std::string key{};
    std::set<std::string> keys{};
  };
  std::string file_;
  std::vector<Level> levels_;
};

/// Expected instead of what a parser stops at (at `at`): other formats have comments, commas at ends and single quotes.
std::string expected_at(const std::string& text, std::size_t at) {
  const auto is_space = [](char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; };
  at = std::min(at, text.size());
  while (at > 0 && (at == text.size() || is_space(text[at]))) --at;
  const std::string_view seen(&text[at > 0 ? at - 1 : 0], at > 0 ? 2 : std::min<std::size_t>(1, text.size()));
  if (seen.find('/') != seen.npos || seen.find('#') != seen.npos) return "JSON, which has no comments";
  if (seen.find('\'') != seen.npos) return "JSON, whose texts are in double quotes";
  std::size_t before = at;
  while (before > 0 && is_space(text[before - 1])) --before;
  if (before > 0 && text[before - 1] == ',' && (text[at] == '}' || text[at] == ']'))
    return "JSON, which has no comma after the last entry";
  return "JSON";
}

Json parse(const std::string& text, const fs::path& file) {
  ParsedPlace place(file.string());
  try {
    Json json =
        Json::parse(text, [&](int, Json::parse_event_t event, const Json& parsed) { return place.note(event, parsed); });
    if (!json.is_object()) throw InputError({file.string(), "/", abbreviate(json), "an object"});
    return json;
  } catch (const Json::parse_error& error) {
    const auto end = text.begin() + static_cast<std::ptrdiff_t>(std::min(text.size(), error.byte ? error.byte - 1 : 0));
    const auto line = 1 + std::count(text.begin(), end, '\n');
    std::string what = error.what();  // "[json.exception.parse_error.101] parse error at line 3, column 5: syntax error ..."
    if (const auto colon = what.find(": "); colon != std::string::npos) what = what.substr(colon + 2);
    throw InputError(
        {file.string(), "line " + std::to_string(line), what, expected_at(text, error.byte ? error.byte - 1 : 0)});
  } catch (const Json::out_of_range& error) {  // a number that no double holds
    const std::string_view what = error.what();
    const auto first = what.find('\''), last = what.rfind('\'');
    const std::string_view number = first < last ? what.substr(first + 1, last - first - 1) : what;
    throw InputError({file.string(), place.pointer(), std::string(number), "a number that a double holds"});
  }
}

std::string string_member(const Json& args, const char* key, const fs::path& file) {
  const auto found = args.find(key);
  if (found == args.end() || found->is_null()) return "";
  if (!found->is_string()) throw InputError({file.string(), std::string("/") + key, abbreviate(*found), "a path"});
  return found->get<std::string>();
}

void apply_patch(Json& args, const Json& patch, const fs::path& file) {
  if (!patch.is_array()) throw InputError({file.string(), "/patch", abbreviate(patch), "a list of JSON Patch operations"});
  for (std::size_t i = 0; i < patch.size(); ++i) {
    try {
      args = args.patch(Json::array({patch[i]}));
    } catch (const Json::exception& error) {
      throw InputError({file.string(), "/patch/" + std::to_string(i), abbreviate(patch[i]) + " (" + error.what() + ")",
                        "a JSON Patch operation that applies to the merged scene"});
    }
  }
}

/// Merges `args` (of `file`, with root_path set) over what its `common` names; `chain` are the files being merged.
Json apply_common(Json args, const fs::path& file, std::vector<fs::path> chain, std::vector<std::string>& warnings) {
  if (!args.contains("common")) {
    if (args.contains("patch"))
      throw InputError({file.string(), "/patch", "a patch without \"common\"", "both or neither: it would not be applied"});
    return args;
  }
  const std::string common = string_member(args, "common", file);
  args.erase("common");
  if (common.empty()) return args;

  const fs::path base_file = resolve_path(common, string_member(args, "root_path", file), file);
  warn_of_working_folder("/common", common, string_member(args, "root_path", file), file, warnings);
  const fs::path identity = fs::weakly_canonical(base_file);
  if (std::find(chain.begin(), chain.end(), identity) != chain.end())
    throw InputError(
        {file.string(), "/common", "'" + common + "', which is being merged already", "no cycle of common files"});
  chain.push_back(identity);

  Json base = parse(read_text(base_file, file.string(), "/common"), base_file);
  const std::string base_root = string_member(base, "root_path", base_file);
  base["root_path"] = base_root.empty() ? base_file.string() : resolve_path(base_root, base_file, base_file).string();
  Json merged = apply_common(std::move(base), base_file, std::move(chain), warnings);

  const Json explicit_root = merged["root_path"];
  const Json patch = args.value("patch", Json::array());
  args.erase("patch");
  merged.merge_patch(args);
  if (!base_root.empty()) merged["root_path"] = explicit_root;
  apply_patch(merged, patch, file);
  return merged;
}

[[noreturn]] void refuse_override(const Override& override, const std::string& found, const std::string& expected) {
  throw InputError({"", "--set " + override.pointer + "=" + override.value, found, expected});
}

/// The member or element that a token names, made if it is not there.
Json& descend(Json& parent, const std::string& token, const Override& override) {
  if (parent.is_null()) parent = Json::object();
  if (parent.is_object()) return parent[token];
  if (!parent.is_array())
    refuse_override(override, abbreviate(parent) + " above '" + token + "'", "an object or a list there");
  if (token == "-") return parent.emplace_back();
  const bool is_index = !token.empty() && token.size() < 9 && token.find_first_not_of("0123456789") == std::string::npos;
  const std::size_t index = is_index ? std::stoul(token) : parent.size() + 1;
  if (index > parent.size())
    refuse_override(override, "index '" + token + "'", "0 to " + std::to_string(parent.size()) + ", or -");
  return index == parent.size() ? parent.emplace_back() : parent[index];
}

void apply_override(Json& args, const Override& override) {
  Json value;
  try {
    value = Json::parse(override.value);
  } catch (const Json::out_of_range&) {
    refuse_override(override, override.value, "numbers that a double holds");
  } catch (const Json::exception&) {
    refuse_override(override, "'" + override.value + "'", "JSON (a string needs its quotes: '\"text\"')");
  }
  Json* place = &args;
  try {
    Json::json_pointer pointer(override.pointer);
    if (pointer.empty()) refuse_override(override, "an empty pointer", "a pointer to a key, such as /time/dt");
    std::vector<std::string> tokens;
    for (; !pointer.empty(); pointer.pop_back()) tokens.insert(tokens.begin(), pointer.back());
    for (const auto& token : tokens) place = &descend(*place, token, override);
  } catch (const Json::exception&) {
    refuse_override(override, "'" + override.pointer + "'", "a JSON pointer, such as /time/dt");
  }
  *place = std::move(value);
}

/// A null is as good as absent in every place of the format.
void remove_null_members(Json& json) {
  if (json.is_object())
    for (auto member = json.begin(); member != json.end();)
      member = member->is_null() ? json.erase(member) : std::next(member);
  if (json.is_structured())
    for (auto& child : json) remove_null_members(child);
}

}  // namespace

Document load_document(const fs::path& file, const std::vector<Override>& overrides) {
  Json args = parse(read_text(file, file.string(), ""), file);
  if (string_member(args, "root_path", file).empty()) args["root_path"] = file.string();
  std::vector<std::string> warnings;
  args = apply_common(std::move(args), file, {fs::weakly_canonical(file)}, warnings);
  for (const Override& override : overrides) apply_override(args, override);

  Document document{file, string_member(args, "root_path", file), std::move(args)};
  document.warnings = std::move(warnings);
  document.json.erase("root_path");
  remove_null_members(document.json);
  return document;
}

Document parse_document(const std::string& text, const std::string& name, const std::vector<Override>& overrides) {
  Document document{name, ".", parse(text, name)};
  for (const Override& override : overrides) apply_override(document.json, override);
  remove_null_members(document.json);
  return document;
}

}  // namespace itr::scene
