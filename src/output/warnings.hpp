// SPDX-License-Identifier: MIT
// The warnings of a run: in the line of the step that they belong to, so that --resume keeps them, and counted in
// summary.json.
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace itr::output {

/// The text without its numbers: what two warnings of one kind have in common.
std::string kind_of_warning(std::string_view text);

class WarningList {
 public:
  /// Passes over what was there before --resume.
  void add(const std::string& text);
  /// Restores the warnings in the lines of a steps.jsonl, into an empty list.
  void restore(const std::filesystem::path& log);
  int count() const { return count_; }
  /// Takes the list of warnings that have come since the last call.
  nlohmann::ordered_json take_new();
  /// Returns `{"warning_count":3,"warnings":[{"text":"the first of its kind","count":3}]}`.
  nlohmann::ordered_json summary_members() const;

 private:
  struct Kind {
    std::string kind, text;
    int count = 0;
  };
  void count(const std::string& text);

  std::vector<Kind> kinds_;
  std::vector<std::string> new_;
  std::set<std::string> stored_;
  int count_ = 0;
};

}  // namespace itr::output
