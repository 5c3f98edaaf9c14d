// SPDX-License-Identifier: MIT
// The two files that make one thing of the stored frames: sim.xdmf, which ParaView opens, and sim.h5, which links them.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "frame_links.hpp"
#include "series_text.hpp"

namespace itr::output {

/// One stored frame, as the index needs to know it.
struct FrameEntry {
  std::string file;  ///< relative to the run's folder: "frames/000000.h5"
  double t = 0;      ///< [s]
  int dim = 0;
  int vertices = 0, cells = 0;     ///< vertices: with the nodes of curved edges
  bool is_quadratic = false;       ///< some edges are curved, and drawn so
  int drawn_nodes = 0;             ///< rows of /drawn/x, which is there where others are straight
  std::vector<std::string> asked;  ///< fields that not every frame has, see kAskedFields
};

/// Both files are readable at any moment. A frame costs the same however many there are: sim.h5 grows by a link, and
/// sim.xdmf follows in intervals that double, see SeriesText.
class TimeSeries {
 public:
  /// Begins both files anew with frames that are stored already; sim.xdmf is there from the first frame on.
  TimeSeries(const std::filesystem::path& directory, const std::vector<FrameEntry>& stored);
  /// Takes in a new frame.
  void add(const FrameEntry& entry);
  /// Leaves out the newest frame.
  void drop_last();
  /// Brings both files up to date.
  void write();

 private:
  FrameLinks links_;
  SeriesText text_;
};

}  // namespace itr::output
