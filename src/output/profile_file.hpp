// SPDX-License-Identifier: MIT
// profile.jsonl: where the time of each step went, a line a step.
#pragma once

#include <filesystem>

#include "core/profile.hpp"
#include "files.hpp"

namespace itr::output {

constexpr const char* kProfileFile = "profile.jsonl";

/// Collects the times of this thread while it lives. Steps of an earlier process are not in the file.
class ProfileFile {
 public:
  ProfileFile(const std::filesystem::path& directory, int threads);
  /// Writes what was collected since the last call.
  void add(int step);

 private:
  LineFile file_;
  int threads_;
  Profile profile_;
  Profile::Active active_{&profile_};
};

}  // namespace itr::output
