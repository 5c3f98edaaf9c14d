// SPDX-License-Identifier: MIT
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "itr/frame.hpp"
#include "itr/options.hpp"

namespace itr::cli {

/// Says how far off the results of a run are estimated to be: the largest force of each curve of `forces`, the text of
/// forces.csv, or the energy of the `last` step where there are none. Empty: nobody asked.
std::vector<std::string> describe_errors(const std::string& forces, const StepReport& last, const Units& units);

/// "refine the mesh first": of what reduces the error of a source.
std::string advice_of(ErrorSource source);

/// Sizes of the estimated errors by source of the largest force or displacement of a name, by its size, as the texts of
/// forces.csv or points.csv have them. None: the errors are not known.
std::optional<std::array<double, kErrorSources>> relative_peak_error(const std::string& name, const std::string& forces,
                                                                     const std::string& points);

}  // namespace itr::cli
