// SPDX-License-Identifier: MIT
#pragma once

#include "plan.hpp"

namespace itr::cli {

/// Runs what study::make_plan says, each run in a process of its own, goes on where an earlier one was stopped, and writes
/// study.{csv,json,md,svg}. Returns the exit status; throws InputError.
int run_study(const study::Options& options);

}  // namespace itr::cli
