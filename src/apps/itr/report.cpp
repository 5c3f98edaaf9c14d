// SPDX-License-Identifier: MIT
#include "report.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "itr/core/error.hpp"
#include "output/file_list.hpp"
#include "run.hpp"

namespace itr::cli {

namespace {

namespace fs = std::filesystem;

std::string read_text(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

report::ReportSummary report_study(const fs::path& directory, const fs::path& file, const report::ReportOptions& options) {
  const fs::path source = directory / "study.json";
  const std::string text = read_text(source);
  const nlohmann::json results = nlohmann::json::parse(text, nullptr, false);
  if (!results.is_object() || !results.contains("runs") || !results["runs"].is_array())
    throw InputError({source.string(), "", "no results of a study", "what `itr study` writes"});
  std::vector<report::StudyRun> runs;
  for (const auto& run : results["runs"])
    if (run.value("status", "") != "failed")
      runs.push_back({run.value("run", ""), directory / "runs" / run.value("run", "")});
  return report::write_study_report(fs::canonical(directory).filename().string(), text, read_text(directory / "study.svg"),
                                    runs, file, options);
}

}  // namespace

int report(const std::string& directory, std::string file, const report::ReportOptions& options) {
  const bool is_study = fs::exists(fs::path(directory) / "study.json");
  if (file.empty()) {
    file = (fs::path(directory) / kReportFile).string();
    if (!is_study && output::is_foreign(directory, kReportFile))
      throw InputError({file, "file", "one that no run wrote", "-o FILE, or that this file is moved away"});
  }
  const auto summary = is_study ? report_study(directory, file, options) : report::write_report(directory, file, options);
  fmt::print("{}: {} {}, {:.1f} MB; opens in a browser\n", file, summary.frames, is_study ? "runs" : "frames", summary.mb);
  for (const auto& note : summary.notes) fmt::print("{}\n", note);
  return done;
}

}  // namespace itr::cli
