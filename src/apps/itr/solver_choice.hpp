// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

#include "itr/linear/registry.hpp"
#include "run.hpp"

namespace itr::cli {

/// The linear solver of a run, and what of the scene's wishes it does not meet.
struct SolverChoice {
  std::string name;  ///< as the registry has it, or "auto"
  std::vector<std::string> warnings;
};

/// Puts `--solver` over the scene's solvers. Throws InputError at the place where a wrong one was asked for.
SolverChoice choose_solver(LinearOptions& linear, const RunOptions& options, linear::Registry& registry);

}  // namespace itr::cli
