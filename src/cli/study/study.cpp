// SPDX-License-Identifier: MIT
#include "study.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <csignal>
#include <fstream>

#include "cli/run.hpp"
#include "itr/core/error.hpp"
#include "plot.hpp"
#include "process.hpp"
#include "report.hpp"

namespace itr::cli {

namespace {

namespace fs = std::filesystem;
using namespace study;

volatile std::sig_atomic_t interrupted = 0;

void on_interrupt(int) { interrupted = 1; }

std::vector<std::string> arguments_of(const PlannedRun& run, const Options& options, const fs::path& folder) {
  std::vector<std::string> words = {"run",       options.scene.string(),          "-o",      folder.string(),
                                    "--threads", std::to_string(options.threads), "--resume"};
  if (!run.solver.empty()) words.insert(words.end(), {"--solver", run.solver});
  for (const auto& set : run.overrides) words.insert(words.end(), {"--set", set.pointer + "=" + set.value});
  return words;
}

/// The last of what it said of itself: lines from the last one that begins with "itr: ".
std::string last_message(const fs::path& log) {
  std::ifstream file(log);
  std::string message;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("itr: "))
      message = line.substr(5);
    else if (!message.empty())
      message += "\n" + line;
  }
  return message;
}

/// Empty: it finished.
std::string describe_failure(const ProcessEnd& end, const fs::path& log, double time_limit) {
  if (end.timed_out && end.status != done) return fmt::format("took longer than {:g} s", time_limit);
  if (end.signal != 0) return fmt::format("ended by signal {}", end.signal);
  if (end.status == done) return "";
  const std::string message = last_message(log);
  return message.empty() ? fmt::format("ended with status {}", end.status) : message;
}

void show(const Row& row, std::size_t number, std::size_t count) {
  const std::string head = fmt::format("[{}/{}] {}", number, count, row.run.name);
  if (!row.finished) return spdlog::info("{}: {}", head, row.reason);
  std::string text = fmt::format("{}: {:.3g} processor s, {} vertices, {:.0f} MB", head, row.processor_seconds, row.vertices,
                                 row.memory_mb);
  if (row.errors) text += fmt::format("; L2 {:.2e}, H1 {:.2e}", row.errors->l2, row.errors->h1);
  spdlog::info("{}", text);
}

class Study {
 public:
  explicit Study(const Options& options) : options_(options), plan_(make_plan(options)) {
    directory_ = options.directory.empty() ? fs::path("study") / options.scene.stem() : options.directory;
    fs::create_directories(directory_ / "runs");
    results_.scene = options.scene.string();
    results_.dim = plan_.dim;
    results_.is_dynamic = plan_.is_dynamic;
    results_.frames = options.frames;
    for (const auto& set : options.overrides)
      results_.settings += fmt::format("{}`{}={}`", results_.settings.empty() ? "" : ", ", set.pointer, set.value);
    if (!options.solver.empty())
      results_.settings += fmt::format("{}solver `{}`", results_.settings.empty() ? "" : ", ", options.solver);
  }

  int run() {
    std::signal(SIGINT, on_interrupt);
    std::signal(SIGTERM, on_interrupt);
    for (const auto& planned : plan_.runs) {
      results_.rows.push_back(run_one(planned));
      Row& row = results_.rows.back();
      if (interrupted) {
        fmt::print(stderr, "itr: interrupted in {}; the same command goes on from there\n", planned.name);
        return simulation_stopped;
      }
      measure(row);
      show(row, results_.rows.size(), plan_.runs.size());
    }
    for (Row& row : results_.rows) measure(row);  // what waited for the run that it is compared with
    write();
    const bool any = std::any_of(results_.rows.begin(), results_.rows.end(), [](const Row& row) { return row.finished; });
    return any ? done : simulation_stopped;
  }

 private:
  fs::path folder_of(const std::string& name) const { return directory_ / "runs" / name; }

  Row run_one(const PlannedRun& planned) {
    const fs::path folder = folder_of(planned.name), log = directory_ / "runs" / (planned.name + ".log");
    const ProcessEnd end =
        run_this_program(arguments_of(planned, options_, folder), log, options_.time_limit, [] { return interrupted != 0; });
    Row failed;
    failed.run = planned;
    failed.reason = describe_failure(end, log, options_.time_limit);
    if (!failed.reason.empty()) return failed;
    return read_row(planned, folder);
  }

  /// The folder that a run is compared with; empty: none, or none yet.
  fs::path reference_of(const Row& row) {
    if (row.run.reference != plan_.reference) {
      const bool is_there = finished(row.run.reference);
      return is_there && row.run.reference != row.run.name ? folder_of(row.run.reference) : fs::path();
    }
    if (!options_.reference.empty()) return options_.reference;
    if (finished(plan_.reference)) return folder_of(plan_.reference);
    return finished(plan_.fallback) && row.run.name != plan_.fallback ? folder_of(plan_.fallback) : fs::path();
  }

  bool finished(const std::string& name) const {
    return std::any_of(results_.rows.begin(), results_.rows.end(),
                       [&](const Row& row) { return row.run.name == name && row.finished; });
  }

  void measure(Row& row) {
    if (!row.finished || row.errors || (row.run.reference.empty() && options_.reference.empty())) return;
    const fs::path reference = reference_of(row);
    if (!reference.empty()) row.errors = measure_errors(folder_of(row.run.name), reference, plan_.is_dynamic);
  }

  std::string describe_reference() const {
    if (!options_.reference.empty()) return "the run in `" + options_.reference.string() + "`";
    const std::string& name = finished(plan_.reference) ? plan_.reference : plan_.fallback;
    for (const Row& row : results_.rows)
      if (row.run.name == name)
        return fmt::format("`{}` ({}: {} vertices, potential {:.8g} J in the last step)", name, row.run.label, row.vertices,
                           row.potential);
    return "nothing";
  }

  void write() {
    results_.reference = describe_reference();
    const std::string text = page(results_);
    const std::pair<const char*, std::string> files[] = {{"study.csv", csv(results_)},
                                                         {"study.json", json(results_)},
                                                         {"study.md", text},
                                                         {"study.svg", work_precision_svg(results_)}};
    for (const auto& [name, content] : files) {
      std::ofstream file(directory_ / name, std::ios::binary);
      if (!(file << content).flush())
        throw InputError({(directory_ / name).string(), "", "not written", "a folder with space"});
    }
    fmt::print("{0}\nThis page, study.csv, study.json and study.svg are in {1}; `itr report {1}` shows them in a browser\n",
               text, directory_.string());
  }

  const Options& options_;
  Plan plan_;
  fs::path directory_;
  Results results_;
};

}  // namespace

int run_study(const study::Options& options) { return Study(options).run(); }

}  // namespace itr::cli
