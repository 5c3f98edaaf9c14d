// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "itr/scene/scene.hpp"

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
  bool report = false;         ///< at the end, finished or not, the folder gets report.html
};

enum ExitStatus { done = 0, bad_input = 2, simulation_stopped = 3, certificate_failed = 4 };

/// Runs a scene and writes its results. Returns the exit status; throws InputError.
int run(const RunOptions& options);

}  // namespace itr::cli
