// SPDX-License-Identifier: MIT
// Plans a study: a table of series, and the runs that it makes of a scene.
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
  std::filesystem::path second_reference;  ///< of another that tells what the first is worth; empty: unknown, or a run
  double reference_tolerance = 0;          ///< of that run's splits [J]; 0: a sixteenth of the smallest of the study
  int frames = 10;                         ///< times at which runs are compared
  double time_limit = 0;                   ///< of a run [s]; 0: none
};

/// A kind of run, as a row of the table.
struct Series {
  enum class Kind {
    levels,      ///< a run for each uniform level
    rows,        ///< the same with about as many cells in rows, where the body is a box; else none
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
  bool has_contact = false, has_friction = false;
  /// Runs to compare with: the first of these that splits anything; none where Options::reference is.
  std::vector<PlannedRun> references;
  std::vector<PlannedRun> runs;  ///< without these
  std::string finest;            ///< uniform level; compared with where no reference finishes
  std::string coarser;           ///< that before it; tells then what the finest is worth
  std::string notes;             ///< what holds for all runs that the scene does not say
};

inline constexpr const char* kReference = "reference";  ///< what PlannedRun::reference names, and the first's run
inline constexpr const char* kSecondReference = "second-reference";  ///< run that tells what the reference is worth

/// Where a study's files are.
std::filesystem::path directory_of(const Options& options);

/// Writes the meshes that runs need and the scene does not have. Throws InputError: for the scene, and for names of series
/// that there are not.
Plan make_plan(const Options& options);

}  // namespace itr::cli::study
