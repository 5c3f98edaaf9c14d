// SPDX-License-Identifier: MIT
// Resources that this process has used, and those that it may use.
#pragma once

#include <filesystem>

namespace itr {

/// Most memory that this process has held [MB].
double peak_rss_mb();
/// Returns the processor time of all threads of this process [s].
double processor_seconds_now();

/// Returns how many cores this process may run on: those of its affinity, or fewer where a control group limits its
/// processor time. `root`: where /proc and /sys are.
int available_cores(const std::filesystem::path& root = "/");

}  // namespace itr
