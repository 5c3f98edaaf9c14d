// SPDX-License-Identifier: MIT
#include "commands.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "itr/core.hpp"
#include "output/file_list.hpp"

namespace itr::cli {

namespace fs = std::filesystem;

int report(const std::string& directory, std::string file, const report::ReportOptions& options) {
  const bool is_study = fs::exists(fs::path(directory) / "study.json");
  if (file.empty()) {
    file = (fs::path(directory) / kReportFile).string();
    if (!is_study && output::is_foreign(directory, kReportFile))
      throw InputError({file, "file", "one that no run wrote", "-o FILE, or that this file is moved away"});
  }
  const auto summary =
      is_study ? report::write_study_report(directory, file, options) : report::write_report(directory, file, options);
  fmt::print("{}: {} {}, {:.1f} MB; opens in a browser\n", file, summary.frames, is_study ? "runs" : "frames", summary.mb);
  for (const auto& note : summary.notes) fmt::print("{}\n", note);
  return done;
}

}  // namespace itr::cli
