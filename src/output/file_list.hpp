// SPDX-License-Identifier: MIT
// itr-files.txt of a folder: the names of the files that runs wrote there, and the processes of these runs, a line each.
#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <string_view>

namespace itr::output {

constexpr const char* kFileList = "itr-files.txt";
/// First line of the list.
constexpr std::string_view kFileListHead = "Files that itr run wrote here: it removes and replaces no others.\n";
constexpr std::string_view kProcessLine = "process ";
/// Stands in a list while its files are removed.
constexpr std::string_view kRemovalLine = "removing";

struct FileList {
  std::set<std::string> names;  ///< relative to the folder; only such as runs write
  std::set<int> processes;
  int last_process = 0;
  bool is_being_removed = false;  ///< a run began to remove all of these files
};

/// The step of a frame's name, frames/NNNNNN.h5 or vtu/NNNNNN.vtu; -1: of another file.
int step_of_name(std::string_view name);

/// The list of a folder. Without a list, as versions before it left folders: the files that they wrote. Throws InputError
/// where the list is none of ours.
FileList read_file_list(const std::filesystem::path& directory);

/// Names of `list` that are there.
std::set<std::string> files_there(const std::filesystem::path& directory, const FileList& list);

/// Whether a file of this name is there that no run wrote.
bool is_foreign(const std::filesystem::path& directory, const std::string& name);

/// Adds a file to the list of a folder that has a list.
void add_to_file_list(const std::filesystem::path& directory, const std::string& name);

}  // namespace itr::output
