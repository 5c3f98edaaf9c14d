// SPDX-License-Identifier: MIT
// Re-checks stored frames with exact predicates, each by itself: every cell has a positive volume, at rest and now; no
// surfaces share a point but that of a common vertex or edge; no obstacle (points and edges too) is inside of a body or of a
// closed proxy, and no body inside of a body. What happens between two frames it cannot see: a point that has gone through a
// body by the next frame is a matter of the steps.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace itr::output {

struct Certificate {
  int frames = 0;
  std::vector<std::string> violations;  ///< one line each: frame, what, which ids; also of arrays that are damaged
  bool passed() const { return violations.empty() && frames > 0; }
};

/// Reads DIR/frames/*.h5. Throws InputError if DIR has no frames or a frame cannot be read.
Certificate certify(const std::filesystem::path& directory);

}  // namespace itr::output
