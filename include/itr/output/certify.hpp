// SPDX-License-Identifier: MIT
// Re-checks stored frames with exact predicates: no intersection of surfaces, no inverted cell.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace itr::output {

struct Certificate {
  int frames = 0;
  std::vector<std::string> violations;  ///< one line each: frame, what, which ids
  bool passed() const { return violations.empty() && frames > 0; }
};

/// Reads DIR/frames/*.h5. Throws InputError if DIR has no frames or a frame cannot be read.
Certificate certify(const std::filesystem::path& directory);

}  // namespace itr::output
