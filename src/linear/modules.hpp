// SPDX-License-Identifier: MIT
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "itr/module.h"
#include "itr/solver.hpp"

namespace itr::linear {

struct ModuleRow {
  BackendInfo info;  ///< not available: `reason` says why, the name is the file's
  EngineFactory factory;
  const itr_engine* engine = nullptr;
};

/// Folders in which modules are looked for: ITR_BACKEND_PATH, the install tree, the build tree.
std::vector<std::filesystem::path> module_folders();
/// Loads a module; one row an engine, or one row with the reason why it does not load. It stays loaded.
std::vector<ModuleRow> load_module(const std::filesystem::path& file);

}  // namespace itr::linear
