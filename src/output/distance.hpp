// SPDX-License-Identifier: MIT
// How far two runs of one scene are apart, each on its own meshes: from their stored frames.
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "itr/core.hpp"

namespace itr::output {

/// Distance of a frame from a reference at the same time. Bodies are told apart by their ids, unless only together they have
/// the same shape.
struct FrameDistance {
  double l2 = 0;       ///< (integral of |u - u_ref|^2 over the rest bodies)^(1/2) [m^(1 + Dim/2)]
  double h1_semi = 0;  ///< the same of grad u - grad u_ref [m^(Dim/2)]
  double reference_l2 = 0, reference_h1_semi = 0;  ///< of u_ref by itself
  /// Hausdorff distance of the bodies' present boundaries [m]: to a thousandth of itself or a millionth of their extent.
  double surface = 0;
  /// Largest fraction of either's rest volume that the other does not cover: 0 to round-off for meshes of one shape. There
  /// the integrals leave out what only one of them has.
  double uncovered = 0;
};

/// Integrals are exact, over the intersections of the cells at rest; the two may have other units. Throws InputError where a
/// file is unreadable or the two have different dimensions.
FrameDistance frame_distance(const std::filesystem::path& frame, const std::filesystem::path& reference);

/// Totals over all bodies in a frame, where its scene asked for them (FieldOptions).
struct FrameTotals {
  int step = 0;
  Units units;                           ///< of all numbers here; below they are named as of SI units
  double t = 0;                          ///< [s]
  std::optional<double> kinetic_energy;  ///< [J]
  std::vector<double> momentum;          ///< Dim numbers [kg m/s], or none
};

/// Steps of the frames in DIR/frames and their files. Throws InputError where one is unreadable.
struct ListedFrame {
  std::filesystem::path file;
  FrameTotals totals;
};
std::vector<ListedFrame> list_frames(const std::filesystem::path& directory);

}  // namespace itr::output
