// SPDX-License-Identifier: MIT
// The two files that make one thing of the stored frames: sim.xdmf, which ParaView opens, and sim.h5, which links them.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

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

/// Both files are replaced as a whole, so that they are readable at any moment. sim.h5 follows at every frame. The text of
/// sim.xdmf is much longer, and replacing it every time would cost O(n^2), so it follows as long as that takes a small share
/// of the time that passes, or in steps that grow with its length.
class TimeSeries {
 public:
  explicit TimeSeries(std::filesystem::path directory);
  ~TimeSeries();
  /// Takes in a frame that was stored earlier; the files follow with the next write or add.
  void append(const FrameEntry& entry);
  /// Takes in a new frame.
  void add(const FrameEntry& entry);
  /// Leaves out the newest frame.
  void drop_last();
  /// Brings both files up to date.
  void write();

 private:
  struct Links;
  void write_links();
  void write_text();

  std::filesystem::path directory_;
  std::unique_ptr<Links> links_;
  std::vector<std::string> files_;
  std::vector<std::size_t> text_ends_;  ///< length of text_ after each frame
  std::string text_;                    ///< of the grids
  std::size_t num_written_ = 0;         ///< frames that sim.xdmf has
  double last_write_ = 0, write_seconds_ = 0;
};

}  // namespace itr::output
