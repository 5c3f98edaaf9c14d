// SPDX-License-Identifier: MIT
#include "file_list.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <fstream>
#include <utility>

#include "itr/core.hpp"

namespace itr::output {

namespace {

namespace fs = std::filesystem;

/// How files that a run writes beside its frames begin.
constexpr std::array<std::pair<std::string_view, std::string_view>, 11> kFiles = {{
    {"steps.jsonl", "{\"step\":"},
    {"summary.json", "{\"scene\":"},
    {"forces.csv", "step,t,name,"},
    {"points.csv", "step,t,name,"},
    {"profile.jsonl", "{\"step\":"},
    {"sim.h5", "\x89HDF"},
    {"sim.xdmf", "<?xml"},
    {"sim.xdmf.part", "<?xml"},
    {"sim.pvd", "<?xml"},
    {"sim.pvd.part", "<?xml"},
    {"report.html", "<!"},
}};

bool begins_with(const fs::path& path, std::string_view head) {
  std::string found(head.size(), '\0');
  std::ifstream(path, std::ios::binary).read(found.data(), static_cast<std::streamsize>(found.size()));
  return found == head;
}

bool is_name_of_run(std::string_view name) {
  return step_of_name(name) >= 0 ||
         std::any_of(kFiles.begin(), kFiles.end(), [&](const auto& file) { return file.first == name; });
}

/// Files of a run of a version without lists.
std::set<std::string> find_unlisted(const fs::path& directory) {
  std::set<std::string> names;
  if (!begins_with(directory / kFiles[0].first, kFiles[0].second)) return names;
  for (const auto& [name, head] : kFiles)
    if (begins_with(directory / name, head)) names.emplace(name);
  std::error_code none;
  for (const char* folder : {"frames", "vtu"})
    for (const auto& entry : fs::directory_iterator(directory / folder, none))
      if (const std::string name = std::string(folder) + "/" + entry.path().filename().string();
          step_of_name(name) >= 0 && begins_with(entry.path(), name.front() == 'f' ? "\x89HDF" : "<?xml"))
        names.insert(name);
  return names;
}

int number_of(std::string_view digits) {
  int number = -1;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  return error == std::errc() && end == digits.data() + digits.size() ? number : -1;
}

}  // namespace

int step_of_name(std::string_view name) {
  constexpr std::size_t kLeast = 6, kMost = 9;
  constexpr std::pair<std::string_view, std::string_view> kKinds[] = {{"frames/", ".h5"}, {"vtu/", ".vtu"}};
  for (const auto& [folder, ending] : kKinds) {
    if (!name.starts_with(folder) || !name.ends_with(ending)) continue;
    const std::string_view digits = name.substr(folder.size(), name.size() - folder.size() - ending.size());
    const bool is_number =
        digits.size() >= kLeast && digits.size() <= kMost && digits.find_first_not_of("0123456789") == digits.npos;
    return is_number ? number_of(digits) : -1;
  }
  return -1;
}

FileList read_file_list(const fs::path& directory) {
  FileList list;
  std::ifstream file(directory / kFileList, std::ios::binary);
  std::string line;
  if (!std::getline(file, line)) {
    list.names = find_unlisted(directory);
    return list;
  }
  if (line + '\n' != kFileListHead)
    throw InputError({(directory / kFileList).string(), "first line", "a list that no run wrote",
                      "another folder (-o), or that this file is moved away"});
  while (std::getline(file, line) && !file.eof()) {  // one that a killed run began has no end, and names no file yet
    if (is_name_of_run(line)) list.names.insert(line);
    if (line == kRemovalLine) list.is_being_removed = true;
    if (!line.starts_with(kProcessLine)) continue;
    list.last_process = number_of(std::string_view(line).substr(kProcessLine.size()));
    list.processes.insert(list.last_process);
  }
  return list;
}

std::set<std::string> files_there(const fs::path& directory, const FileList& list) {
  std::set<std::string> names;
  std::error_code none;
  for (const std::string& name : list.names)
    if (fs::is_regular_file(fs::symlink_status(directory / name, none))) names.insert(names.end(), name);
  return names;
}

bool is_foreign(const fs::path& directory, const std::string& name) {
  std::error_code none;
  return fs::exists(fs::symlink_status(directory / name, none)) && !read_file_list(directory).names.contains(name);
}

void add_to_file_list(const fs::path& directory, const std::string& name) {
  if (!is_name_of_run(name) || !fs::exists(directory / kFileList) || read_file_list(directory).names.contains(name)) return;
  const std::string line = '\n' + name + '\n';  // the line before may have no end, where a run was killed
  const int descriptor = ::open((directory / kFileList).c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
  if (descriptor < 0) return;
  [[maybe_unused]] const ssize_t written = ::write(descriptor, line.data(), line.size());
  ::close(descriptor);
}

}  // namespace itr::output
