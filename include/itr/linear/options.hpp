// SPDX-License-Identifier: MIT
#pragma once

#include <map>
#include <string>
#include <vector>

namespace itr {

/// Which linear solver a simulation uses. Names as `itr solvers` lists them, their aliases, or "auto".
struct LinearOptions {
  std::vector<std::string> solvers = {"eigen"};  ///< the first one that there is
  /// Tried in this order on a matrix that the solver cannot factorise or solve to the asked residual. A matrix that is not
  /// positive definite is an answer, not a failure: Newton projects it.
  std::vector<std::string> fallback = {};
  std::map<std::string, std::map<std::string, std::string>> options = {};  ///< by solver name: {"ordering", "metis"}
};

}  // namespace itr
