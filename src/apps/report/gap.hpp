// SPDX-License-Identifier: MIT
#pragma once

#include <vector>

#include "output/frame_file.hpp"

namespace itr::report {

using output::StoredFrame;

/// Distance of each node on the bodies' surface to what else may be touched: obstacles, and surfaces of bodies that share no
/// vertex with its own; `most` where nothing is nearer, and inside [m]. Empty where there is one body alone.
std::vector<double> gaps(const StoredFrame& frame, double most);

}  // namespace itr::report
