// SPDX-License-Identifier: MIT
// Resources that this process has used.
#pragma once

namespace itr {

/// Most memory that this process has held [MB].
double peak_rss_mb();
/// Returns the processor time of all threads of this process [s].
double processor_seconds_now();

}  // namespace itr
