// SPDX-License-Identifier: MIT
// The folder of a run: one run at a time is at work in it, and removes and replaces only files that runs wrote there.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace itr::output {

/// A folder of results, locked while this lives; the lock ends with the process, however that ends. The file itr-files.txt
/// there has the names of the files that runs wrote.
class Folder {
 public:
  /// Makes the folder where there is none. Throws InputError where it cannot be written or another run is at work in it.
  explicit Folder(std::filesystem::path directory);
  Folder(Folder&& other) noexcept;
  /// Leaves no trace of itself where no run has begun.
  ~Folder();

  const std::filesystem::path& path() const;
  /// Whether files of an earlier run are there.
  bool has_results() const;
  /// Begins a new run that writes `names` beside frames: removes all files of earlier runs. Throws InputError, and removes
  /// nothing, where a file stands there that no run wrote. Returns how many files were removed.
  int begin(const std::vector<std::string>& names);
  /// Goes on with a run, as `begin`, but removes nothing.
  void resume(const std::vector<std::string>& names, int last_step);
  /// Removes what runs wrote of steps after this one, and what is written at the end of a run. Returns how many files.
  int remove_after(int last_step);
  /// Whether the run that has begun writes a file of this name, or wrote it before it went on. Not for frames.
  bool owns(const std::string& name) const;
  /// Lists a file before it is written. Throws InputError where it is there and no run wrote it.
  void claim(const std::string& name);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace itr::output
