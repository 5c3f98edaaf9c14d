// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

#include "itr/frame.hpp"
#include "itr/options.hpp"

namespace itr::cli {

/// Says how far off the results of a run are estimated to be: the largest force of each curve of `forces`, the text of
/// forces.csv, or the energy of the `last` step where there are none. Empty: nobody asked.
std::vector<std::string> describe_errors(const std::string& forces, const StepReport& last, const Units& units);

}  // namespace itr::cli
