// SPDX-License-Identifier: MIT
// forces.csv and points.csv: what /output/forces and /output/points ask for, a line a step and name.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "files.hpp"
#include "itr/frame.hpp"

namespace itr::output {

constexpr const char* kForceFile = "forces.csv";
constexpr const char* kPointFile = "points.csv";

/// A file with lines for each step under a header.
class CurveFile {
 public:
  /// Keeps the lines of steps up to `last_step`; -1: there is no file yet.
  CurveFile(std::filesystem::path path, int last_step);
  /// Without curves or points: nothing, and no file.
  void add(int step, double t, const std::vector<ForceCurvePoint>& curves);
  void add(int step, double t, const std::vector<PointValue>& points);
  /// Takes back the lines of the last step.
  void drop_last();

 private:
  void add(const std::string& header, std::vector<std::string> lines);

  std::filesystem::path path_;
  std::optional<LineFile> file_;
  std::size_t size_before_ = 0;
};

struct ForceRows {
  int frames = 0;  ///< that have forces
  int rows = 0;    ///< of the file
  int added = 0;   ///< to it
};

/// Puts what frames have into the forces.csv of a folder. Rows of steps that have no frame stay. Throws InputError, and
/// changes nothing, where no frame has forces, the file has lines that are no rows, or a run is at work in the folder.
ForceRows rewrite_forces(const std::filesystem::path& directory);

/// Text as forces.csv has it: of that file, its whole lines, or where there is none of the frames. Empty: no forces are
/// stored.
std::string stored_forces(const std::filesystem::path& directory);

}  // namespace itr::output
