// SPDX-License-Identifier: MIT
#include "study.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <fstream>

#include "apps/itr/run.hpp"
#include "itr/core/error.hpp"
#include "linear/modules.hpp"
#include "plot.hpp"
#include "process.hpp"
#include "report.hpp"

namespace itr::cli {

namespace {

namespace fs = std::filesystem;
using namespace study;

constexpr double kLeastSplit = 0.01;  ///< of its uniform level's vertices that a reference has to add
constexpr double kSame = 1e-9;        ///< relative errors below it are of one and the same solution

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

/// Runs find their solver modules beside this program's file; they still do where that is replaced while a study runs.
void keep_module_folders() {
  std::string folders;
  for (const auto& folder : linear::module_folders()) folders += (folders.empty() ? "" : ":") + folder.string();
  setenv("ITR_BACKEND_PATH", folders.c_str(), 1);
}

class Study {
 public:
  explicit Study(const Options& options) : options_(options), plan_(make_plan(options)), directory_(directory_of(options)) {
    fs::create_directories(directory_ / "runs");
    results_.scene = options.scene.string();
    results_.notes = plan_.notes;
    results_.dim = plan_.dim;
    results_.is_dynamic = plan_.is_dynamic;
    results_.has_friction = plan_.has_friction;
    results_.frames = options.frames;
    for (const auto& set : options.overrides)
      results_.settings += fmt::format("{}`{}={}`", results_.settings.empty() ? "" : ", ", set.pointer, set.value);
    if (!options.solver.empty())
      results_.settings += fmt::format("{}solver `{}`", results_.settings.empty() ? "" : ", ", options.solver);
  }

  int run() {
    keep_module_folders();
    std::signal(SIGINT, on_interrupt);
    std::signal(SIGTERM, on_interrupt);
    if (!find_reference()) return simulation_stopped;
    for (const auto& planned : plan_.runs)
      if (!add(planned)) return simulation_stopped;
    for (Row& row : results_.rows) measure(row);  // what waited for the run that it is compared with
    judge_reference();
    write();
    const bool any = std::any_of(results_.rows.begin(), results_.rows.end(), [](const Row& row) { return row.finished; });
    return any ? done : simulation_stopped;
  }

 private:
  fs::path folder_of(const std::string& name) const { return directory_ / "runs" / name; }

  /// False where the study is told to stop.
  bool add(const PlannedRun& planned) {
    results_.rows.push_back(run_one(planned));
    Row& row = results_.rows.back();
    if (interrupted) {
      fmt::print(stderr, "itr: interrupted in {}; the same command goes on from there\n", planned.name);
      return false;
    }
    measure(row);
    show(row, results_.rows.size(), plan_.runs.size() + (options_.reference.empty() ? 1 : 0));
    return true;
  }

  /// Runs references until one splits: one that does not is its uniform level, and against that nothing would be told.
  bool find_reference() {
    for (const auto& planned : plan_.references) {
      if (!add(planned)) return false;
      const Row& row = results_.rows.back();
      reference_ = row.run.name;
      if (!row.finished || row.vertices > (1 + kLeastSplit) * row.first_vertices) return true;
      if (&planned == &plan_.references.back())
        throw InputError({options_.scene.string(), "--reference-tolerance",
                          fmt::format("a reference that is its uniform level: {} vertices, {} of them by splits ({})",
                                      row.vertices, row.vertices - row.first_vertices, row.run.label),
                          "a smaller tolerance, or --reference DIR"});
      spdlog::info("{} splits nothing: {} vertices, as its uniform level", row.run.name, row.vertices);
      results_.rows.pop_back();
    }
    return true;
  }

  Row run_one(const PlannedRun& planned) {
    const fs::path folder = folder_of(planned.name), log = directory_ / "runs" / (planned.name + ".log");
    const ProcessEnd end =
        run_this_program(arguments_of(planned, options_, folder), log, options_.time_limit, [] { return interrupted != 0; });
    Row failed;
    failed.run = planned;
    failed.reason = describe_failure(end, log, options_.time_limit);
    if (!failed.reason.empty()) return failed;
    return read_row(planned, folder, log, plan_.has_contact);
  }

  /// The folder that a run is compared with; empty: none, or none yet.
  fs::path reference_of(const Row& row) const {
    if (row.run.reference != kReference) {
      const bool is_there = finished(row.run.reference);
      return is_there && row.run.reference != row.run.name ? folder_of(row.run.reference) : fs::path();
    }
    if (!options_.reference.empty()) {
      const bool is_itself = fs::exists(options_.reference) && fs::equivalent(options_.reference, folder_of(row.run.name));
      return is_itself ? fs::path() : options_.reference;
    }
    if (finished(reference_)) return folder_of(reference_);
    return finished(plan_.finest) && row.run.name != plan_.finest ? folder_of(plan_.finest) : fs::path();
  }

  const Row* find(const std::string& name) const {
    const auto found = std::find_if(results_.rows.begin(), results_.rows.end(),
                                    [&](const Row& row) { return row.run.name == name && row.finished; });
    return found == results_.rows.end() ? nullptr : &*found;
  }
  bool finished(const std::string& name) const { return find(name) != nullptr; }

  void measure(Row& row) {
    if (!row.finished || row.errors || row.run.reference.empty()) return;
    const fs::path reference = reference_of(row);
    if (!reference.empty()) row.errors = measure_errors(folder_of(row.run.name), reference);
  }

  /// Judges the reference's worth, and whether it is one.
  void judge_reference() {
    const auto take = [&](const Errors& errors, std::string name) {
      results_.worth = errors;
      results_.second_reference = std::move(name);
    };
    const Row* second = find(kSecondReference);
    if (!second && options_.reference.empty() && !finished(reference_)) second = find(plan_.coarser);
    if (!options_.second_reference.empty() && !options_.reference.empty())
      take(measure_errors(options_.second_reference, options_.reference),
           "the run in `" + options_.second_reference.string() + "`");
    else if (second && second->errors)
      take(*second->errors, fmt::format("`{}` ({}: {} vertices)", second->run.name, second->run.label, second->vertices));

    const Row *finest = find(plan_.finest), *reference = find(reference_);
    if (finest && finest->errors && finest->errors->l2 < kSame && finest->errors->h1 < kSame)
      results_.refused = fmt::format("it equals the finest uniform level, `{}`", plan_.finest);
    else if (reference && flies(results_, *reference))
      results_.refused = "a body flies away in it";
    else if (reference && !reference->certified)
      results_.refused = "a frame of it has an intersection or an inversion";
    if (results_.refused.empty()) return;
    results_.worth.reset();
    for (Row& row : results_.rows)
      if (is_against_reference(row)) row.errors.reset();
  }

  std::string describe_reference() const {
    if (!options_.reference.empty()) return "the run in `" + options_.reference.string() + "`";
    const Row* row = find(finished(reference_) ? reference_ : plan_.finest);
    if (!row) return "nothing";
    return fmt::format("`{}` ({}: {} vertices, potential {:.8g} J in the last step)", row->run.name, row->run.label,
                       row->vertices, row->potential);
  }

  void write() {
    results_.reference = describe_reference();
    if (options_.reference.empty()) results_.reference_run = finished(reference_) ? reference_ : plan_.finest;
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
  std::string reference_;  ///< name of the run
  Results results_;
};

}  // namespace

int run_study(const study::Options& options) { return Study(options).run(); }

}  // namespace itr::cli
