// SPDX-License-Identifier: MIT
// The two files that make one thing of the stored frames: sim.xdmf, which ParaView opens, and sim.h5, which links them.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

#include "files.hpp"
#include "frame_links.hpp"

namespace itr::output {

/// The text is head, parts, tail. A part costs the same however many there are: it goes to the end of NAME.part, and the
/// file itself is replaced when the number of its parts has doubled, when long enough ago, and by `write`. It is whole at
/// any moment.
class SeriesText {
 public:
  SeriesText(std::filesystem::path path, const std::string& head, std::string tail);
  /// Removes NAME.part.
  ~SeriesText();
  SeriesText(const SeriesText&) = delete;
  SeriesText& operator=(const SeriesText&) = delete;
  /// Takes in a part that ends with a line; the file follows with the next write or add.
  void append(std::string part);
  void add(std::string part);
  /// Takes back the part that came last. Not twice without another part between.
  void drop_last();
  /// Brings the file up to date.
  void write();

  static std::string part_name(const std::string& name) { return name + ".part"; }

 private:
  std::filesystem::path path_, part_path_;
  std::string tail_;
  LineFile parts_;
  std::size_t length_before_ = 0;  ///< of NAME.part, without its last part
  std::size_t count_ = 0;          ///< of parts
  std::size_t written_ = 0;        ///< that the file has
  double last_write_ = 0, write_seconds_ = 0;
};

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
