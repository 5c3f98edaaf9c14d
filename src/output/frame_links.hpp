// SPDX-License-Identifier: MIT
// sim.h5, whose group /frames links the frames of a run. HDF5's own library changes several places of a file for a link, and
// leaves a file that cannot be read where the process is killed in between.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <vector>

namespace itr::output {

/// A file of HDF5 that grows by a link at a time. Links are messages of the group's header, which is continued from page to
/// page. One write within a page adds a link, so that it is there or not, whatever ends the process.
class FrameLinks {
 public:
  /// Replaces the file by one that links these files, named relative to its folder.
  FrameLinks(std::filesystem::path path, const std::vector<std::string>& files);
  ~FrameLinks();
  FrameLinks(const FrameLinks&) = delete;
  FrameLinks& operator=(const FrameLinks&) = delete;
  /// Links one more file as /frames/NAME, where NAME is its name without folder and ending.
  void append(const std::string& file);
  /// Takes back the link that was appended last. Not twice without another link between.
  void drop_last();

 private:
  void write(std::size_t page, const std::string& bytes);

  std::filesystem::path path_;
  int descriptor_ = -1;
  std::size_t last_page_ = 1;      ///< number of the page that gets the next link
  std::string messages_;           ///< of that page
  std::size_t length_before_ = 0;  ///< of these messages, before the last link
};

}  // namespace itr::output
