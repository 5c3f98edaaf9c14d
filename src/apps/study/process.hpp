// SPDX-License-Identifier: MIT
// Other programs, one at a time.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace itr::cli::study {

struct ProcessEnd {
  int status = 0;          ///< of its exit; -1 where a signal ended it
  int signal = 0;          ///< that ended it; 0: none
  bool timed_out = false;  ///< it was told to end, for the time limit
  bool stopped = false;    ///< it was told to end, as the caller is
};

/// Runs this very program with these arguments; what it prints goes to the end of `log`. After `time_limit` seconds (0:
/// never), or when `is_stopped`, it is told to finish its step and to save; late, it is killed if it does not. It does not
/// outlive this process. Throws InputError where the log cannot be written or no process can be made.
ProcessEnd run_this_program(const std::vector<std::string>& arguments, const std::filesystem::path& log, double time_limit,
                            const std::function<bool()>& is_stopped);

}  // namespace itr::cli::study
