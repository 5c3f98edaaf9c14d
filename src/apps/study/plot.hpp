// SPDX-License-Identifier: MIT
#pragma once

#include <string>

#include "report.hpp"

namespace itr::cli::study {

/// The work-precision diagram as SVG: a row of panels for each measure, a column for each cost, a line for each series; axes
/// are logarithmic.
std::string work_precision_svg(const Results& results);

}  // namespace itr::cli::study
