// SPDX-License-Identifier: MIT
#pragma once

#include <string>

#include "apps/report/report.hpp"

namespace itr::cli {

constexpr const char* kReportFile = "report.html";

/// Shows the run, or the study, in a folder as one HTML file (empty: report.html in the folder) and says what it has.
/// Returns the exit status; throws InputError.
int report(const std::string& directory, std::string file, const report::ReportOptions& options);

}  // namespace itr::cli
