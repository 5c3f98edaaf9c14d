// SPDX-License-Identifier: MIT
// A run, or several side by side, as one HTML file that shows it in a browser: no server, no network, nothing beside it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace itr::report {

struct ReportOptions {
  int every = 1;         ///< of the stored frames, which the page has; the last one it always has
  double max_mb = 30;    ///< of the file: every 2nd, 4th, ... frame is left out until it is smaller
  bool certify = false;  ///< re-checks all stored frames, see certify.hpp, and says so in the page
};

/// Contents of the file, and what was left out for its size.
struct ReportSummary {
  int frames = 0;
  double mb = 0;                   ///< of the file, 10^6 bytes
  std::vector<std::string> notes;  ///< sentences; the page has them too
};

/// Shows the run in `directory`, finished or not. Throws InputError where there are no frames, one is unreadable, or `file`
/// cannot be written.
ReportSummary write_report(const std::filesystem::path& directory, const std::filesystem::path& file,
                           const ReportOptions& options = {});

/// Shows what the study in `directory` found: its diagrams and the last frames of its runs, two side by side. Frames are
/// left out for the size, those of the largest runs first. Throws InputError as write_report.
ReportSummary write_study_report(const std::filesystem::path& directory, const std::filesystem::path& file,
                                 const ReportOptions& options = {});

}  // namespace itr::report
