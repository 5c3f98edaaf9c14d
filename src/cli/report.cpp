// SPDX-License-Identifier: MIT
#include "report.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "run.hpp"

namespace itr::cli {

int report(const std::string& directory, std::string file, const output::ReportOptions& options) {
  if (file.empty()) file = (std::filesystem::path(directory) / "report.html").string();
  const auto summary = output::write_report(directory, file, options);
  fmt::print("{}: {} frames, {:.1f} MB; opens in a browser\n", file, summary.frames, summary.mb);
  for (const auto& note : summary.notes) fmt::print("{}\n", note);
  return done;
}

}  // namespace itr::cli
