// SPDX-License-Identifier: MIT
// Reads the folders of a study's runs, and how far each run is from its reference.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "output/run_distance.hpp"
#include "plan.hpp"

namespace itr::cli::study {

using Errors = output::RunDistance;

/// Warning of a run.
struct Warning {
  std::string text;
  int times = 0;
};

/// One run: what it cost, and what its error is where it finished.
struct Row {
  PlannedRun run;
  bool finished = false;
  std::string reason;      ///< why it did not finish
  bool certified = false;  ///< no frame with an inversion nor, where bodies touch, an intersection
  int steps = 0;
  double unknowns = 0;           ///< mean over the steps
  int first_vertices = 0;        ///< before the first step
  int vertices = 0;              ///< at the end
  double seconds = 0;            ///< of the steps, without output
  double processor_seconds = 0;  ///< the same, of all threads
  double memory_mb = 0;
  int newton_iterations = 0;
  double potential = 0;           ///< incremental potential of the last step [J]: in statics, less is nearer to the limit
  double flight = 0;              ///< largest mean displacement of a body, by the size of bodies and obstacles together
  std::vector<Warning> warnings;  ///< each once, in the order of the log
  std::optional<Errors> errors;
};

/// Reads steps.jsonl and what the run printed, and certifies all frames: where nothing touches, bodies may pass through
/// themselves. Throws InputError where the folder cannot be read.
Row read_row(const PlannedRun& run, const std::filesystem::path& folder, const std::filesystem::path& log, bool has_contact);

/// Distances are kept in the folder until a frame of it or of the reference changes. Throws InputError where the two have no
/// stored time in common, or bodies of other shapes.
Errors measure_errors(const std::filesystem::path& folder, const std::filesystem::path& reference);

}  // namespace itr::cli::study
