// SPDX-License-Identifier: MIT
// The two files that make one thing of the stored frames: sim.xdmf, which ParaView opens, and sim.h5, which links them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace itr::output {

/// One stored frame, as the index needs to know it.
struct FrameEntry {
  std::string file;  ///< relative to the run's folder: "frames/000000.h5"
  double t = 0;      ///< [s]
  int dim = 0;
  int vertices = 0, cells = 0;
};

/// Both files are replaced as a whole, so that they are readable at any moment; replacing them at every frame would cost
/// O(n^2), so they follow in steps that grow with their length (and at least every few seconds).
class TimeSeries {
 public:
  explicit TimeSeries(std::filesystem::path directory) : directory_(std::move(directory)) {}
  void add(FrameEntry entry);
  /// Brings the files up to date.
  void write();

 private:
  bool is_due() const;

  std::filesystem::path directory_;
  std::vector<FrameEntry> entries_;
  std::size_t num_written_ = 0;
  double last_write_ = 0;
};

}  // namespace itr::output
