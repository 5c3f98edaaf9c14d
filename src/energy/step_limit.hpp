// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

namespace itr {

/// Tightest limit of a step: asked for where a solve failed, to say why.
struct StepLimit {
  double step = 1;            ///< fraction of the step that it leaves; 1: nothing limits it
  std::string kind;           ///< "cell", "vertex-edge pair", "vertex-triangle pair" or "edge-edge pair"
  std::vector<int> vertices;  ///< of the cell or of the pair, in the order of `kind`
};

}  // namespace itr
