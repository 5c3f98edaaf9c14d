// SPDX-License-Identifier: MIT
// Checks each stored frame with exact predicates. Every cell has a positive volume, at rest and deformed. Surfaces share no
// point except common vertices and edges. No obstacle, points and edges included, is inside a body or a closed proxy, and no
// body is inside another. Faces that coincide at rest and have not been apart by d-hat since may overlap by d-hat, and
// those that ties bond by their reach. Motion between two frames is not checked; the steps' own collision detection answers
// for it.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "itr/core.hpp"

namespace itr::output {

struct Violation {
  enum class Of { file, cells, surfaces } of;
  std::string text;  ///< one line: frame, what, which ids
};

struct Certificate {
  int frames = 0;
  std::vector<Violation> violations;
  /// Largest mean displacement of a body (by id), over the diagonal of the box of the bodies at rest and the obstacles.
  double flight = 0;
  /// How far curved edges of the surface leave the chords through their nodes, and how far where something else is nearer to
  /// these chords than that, in the frames' units. The curves themselves are checked.
  double overhang = 0, blocked_overhang = 0;
  double overlap = 0;  ///< of closed faces: tied, or coincident at rest and not apart by d-hat since; at most [m]
  Units units{};       ///< of the frames
  bool passed() const { return violations.empty() && frames > 0; }
};

/// Reads DIR/frames/*.h5. Throws InputError if DIR has no frames or a frame cannot be read.
Certificate certify(const std::filesystem::path& directory);

}  // namespace itr::output
