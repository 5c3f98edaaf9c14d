// SPDX-License-Identifier: MIT
// The commands of `itr` that need more than a few lines. Each returns the exit status and throws InputError.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "apps/report/report.hpp"
#include "itr/scene.hpp"
#include "itr/solver.hpp"

namespace itr::cli {

struct RunOptions {
  std::filesystem::path scene;
  std::string directory;  ///< empty: output/directory of the scene, or results/<scene name>
  std::string solver;     ///< empty: the scene's
  int threads = -1;       ///< -1: the scene's; 0: all
  std::vector<scene::Override> overrides;
  bool resume = false;         ///< go on from the newest saved state of the folder, if there is one
  bool allow_changes = false;  ///< then also with another solver, other tolerances, step cuts
  bool overwrite = false;      ///< replace what the folder has
  bool profile = false;        ///< the folder gets profile.jsonl
  bool report = false;         ///< at the end, finished or not, the folder gets report.html
};

/// The linear solver of a run, and what of the scene's wishes it does not meet.
struct SolverChoice {
  std::string name;  ///< as the registry has it, or "auto"
  std::vector<std::string> warnings;
};

/// Puts `--solver` over the scene's solvers. Throws InputError at the place where a wrong one was asked for.
SolverChoice choose_solver(LinearOptions& linear, const RunOptions& options, linear::Registry& registry);

enum ExitStatus { done = 0, bad_input = 2, simulation_stopped = 3, certificate_failed = 4 };

/// Runs a scene and writes its results.
int run(const RunOptions& options);

/// Prints what `run` would model and why, what it would leave out, what it needs, and what looks wrong. Runs nothing.
int explain(const RunOptions& options);

/// Prints what is known of a scene before it runs as one JSON object, all numbers in the scene's units.
int print_facts(const RunOptions& options);

/// Answers each line of its input, an object with a material and its principal logarithmic strains, by a line of responses.
int respond();

constexpr const char* kReportFile = "report.html";

/// Shows the run, or the study, in a folder as one HTML file (empty: report.html in the folder) and says what it has.
int report(const std::string& directory, std::string file, const report::ReportOptions& options);

}  // namespace itr::cli
