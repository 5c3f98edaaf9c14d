// SPDX-License-Identifier: MIT
// Options of remeshing with nothing left open, for tests that call the remesher themselves.
#pragma once

#include "itr/options.hpp"

namespace itr {

inline RemeshOptions remesh_options() {
  RemeshOptions options;
  options.split.acceptance_tolerance = 0;
  options.split.min_edge_length = 0;
  options.collapse.acceptance_tolerance = options.swap.acceptance_tolerance = options.smooth.acceptance_tolerance = -1e-8;
  return options;
}

}  // namespace itr
