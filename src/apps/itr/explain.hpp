// SPDX-License-Identifier: MIT
#pragma once

#include "run.hpp"

namespace itr::cli {

/// Prints what `run` would model and why, what it would leave out, what it needs, and what looks wrong. Runs nothing.
int explain(const RunOptions& options);

}  // namespace itr::cli
