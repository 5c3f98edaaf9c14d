// SPDX-License-Identifier: MIT
// The distance of two runs of one scene, over the times at which both have stored frames.
#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <vector>

namespace itr::output {

/// Over the common times but the first.
struct RunDistance {
  double l2 = 0, h1 = 0;  ///< of the displacement and its gradient: root mean square over time, by that of the reference
  double surface = 0;     ///< largest Hausdorff distance of the bodies' boundaries [m]
  double energy = 0;      ///< root mean square over time: kinetic, elastic, of loads and of contact together [J]
  double momentum = 0;    ///< root mean square over time [kg m/s]; both NaN if frames lack kinetic energy or momentum
  /// Root mean square over time of the reference's kinetic, elastic and contact energy [J]: the size of errors is judged by
  /// it. Loads are left out, since the zero of their energy is anywhere.
  double reference_energy = 0;
  int times = 0;  ///< at least 1
};

enum class Times { all, last };

/// Distance of the run in `folder` from that in `reference`. The scene that `folder` has saved says whether kinetic energy
/// and momentum count. Throws InputError if a folder cannot be read or if the two have no stored time in common, other
/// dimensions or bodies of other shapes.
RunDistance run_distance(const std::filesystem::path& folder, const std::filesystem::path& reference,
                         Times times = Times::all);

/// The object with all members of `distance` by name; NaN becomes null.
nlohmann::ordered_json to_json(const RunDistance& distance);

/// Lines of steps.jsonl, the first of step 0. Throws InputError if a line is no JSON or if there is no step after it.
std::vector<nlohmann::ordered_json> read_steps(const std::filesystem::path& folder);

}  // namespace itr::output
