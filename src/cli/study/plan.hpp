// SPDX-License-Identifier: MIT
// What a study runs: a table of series, and the runs that it makes of a scene.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "itr/scene/scene.hpp"

namespace itr::cli::study {

struct Options {
  std::filesystem::path scene;
  std::filesystem::path directory;         ///< empty: study/<scene name>
  std::string solver;                      ///< empty: the scene's
  int threads = 1;                         ///< of each run
  std::vector<scene::Override> overrides;  ///< of all runs
  std::vector<std::string> series;         ///< names in series(); empty: those that are asked without a word
  int levels = 0;                          ///< uniform refinements beyond the scene's own; 0: 3 in 2D, 2 in 3D
  std::vector<int> starts;                 ///< uniform refinements beyond the scene's own that remeshing begins from
  std::vector<double> tolerances;          ///< of splits [J]; empty: 4, 1, 1/4 and 1/16 times the scene's
  std::filesystem::path reference;         ///< folder of a run to compare with; empty: a run of the study
  double reference_tolerance = 0;          ///< of that run's splits [J]; 0: a quarter of the smallest of the study
  int frames = 10;                         ///< times at which runs are compared
  double time_limit = 0;                   ///< of a run [s]; 0: none
};

/// A kind of run, as a row of the table.
struct Series {
  enum class Kind {
    levels,      ///< a run for each uniform level
    tolerances,  ///< a run for each tolerance and start
    solvers,     ///< a run for each linear solver that is there, on the finest uniform level but one
    time_steps   ///< dt, dt/2 and dt/4 on the finest uniform level but one, against dt/4
  };
  const char* name;
  Kind kind;
  bool is_default;
  const char* what;  ///< for `--help` and reports
  std::vector<scene::Override> overrides;
};
const std::vector<Series>& all_series();

struct PlannedRun {
  std::string name;  ///< "itr-0.1": also its folder
  const Series* series = nullptr;
  std::string label;  ///< "tolerance 0.1 J"
  std::vector<scene::Override> overrides;
  std::string solver;     ///< empty: the scene's
  std::string reference;  ///< name of the run that it is compared with; empty: nothing
};

struct Plan {
  int dim = 0;
  bool is_dynamic = false;  ///< has kinetic energy and momentum
  std::vector<PlannedRun> runs;
  std::string reference;  ///< name of the run that the others are compared with; empty where Options::reference is
  std::string fallback;   ///< compared with where that does not finish: the finest uniform level
};

/// Throws InputError: for the scene, and for names of series that there are not.
Plan make_plan(const Options& options);

}  // namespace itr::cli::study
