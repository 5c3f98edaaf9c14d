// SPDX-License-Identifier: MIT
// Files that are complete or absent, whatever ends the process: written under a temporary name, then renamed. A failure (a
// full disk, a folder that cannot be written) is an InputError with the system's reason, and leaves no temporary file.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <utility>

namespace itr::output {

/// Whether a file has to survive the loss of power, not only of the process: waiting for the disk costs more than a 2D step.
enum class Durability { process, power };

/// The successor of a file while it is written, under a name of its own. Without `replace` it is removed again.
class Successor {
 public:
  explicit Successor(std::filesystem::path path);
  ~Successor();
  Successor(const Successor&) = delete;
  Successor& operator=(const Successor&) = delete;
  void write(std::string_view bytes);
  /// Writes the first `size` bytes of another file.
  void copy(const std::filesystem::path& source, std::size_t size);
  /// Takes the place of the file.
  void replace(Durability durability = Durability::process);

 private:
  std::filesystem::path path_, temporary_;
  int descriptor_ = -1;
};

/// The file that a name of a successor is for, and the process that writes it; empty: the name is of another kind.
std::pair<std::string, int> file_of_successor(const std::string& name);

/// Replaces the file by `bytes`.
void write_file(const std::filesystem::path& path, std::string_view bytes, Durability durability = Durability::process);
/// Waits until the file or folder is on the disk.
void sync(const std::filesystem::path& path);
/// Waits until all files of the file system that has `folder` are on the disk: for many files much faster than one by one.
void sync_file_system(const std::filesystem::path& folder);

/// A file that grows by whole lines: one that could not be written completely is taken back.
class LineFile {
 public:
  /// Keeps the first `keep` bytes of what is there, without a file: none. Throws InputError where there are fewer.
  LineFile(std::filesystem::path path, std::size_t keep);
  ~LineFile();
  LineFile(const LineFile&) = delete;
  LineFile& operator=(const LineFile&) = delete;
  /// `line` without its end.
  void append(std::string line);
  /// Takes back what is after the first `size` bytes.
  void shorten(std::size_t size);
  std::size_t size() const { return size_; }  ///< [bytes]

 private:
  std::filesystem::path path_;
  int descriptor_ = -1;
  std::size_t size_ = 0;
};

}  // namespace itr::output
