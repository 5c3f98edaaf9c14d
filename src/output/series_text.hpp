// SPDX-License-Identifier: MIT
// A text with a part for each frame, such as sim.xdmf.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>

#include "files.hpp"

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

}  // namespace itr::output
