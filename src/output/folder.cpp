// SPDX-License-Identifier: MIT
#include "itr/output.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <deque>
#include <system_error>

#include "file_list.hpp"
#include "files.hpp"
#include "itr/core.hpp"

namespace itr::output {

namespace {

namespace fs = std::filesystem;

InputError unusable(const fs::path& directory, const std::string& reason) {
  return InputError({directory.string(), "output folder", reason, "a folder that can be written"});
}

/// Folders that make_folder would make, the outermost one last.
std::vector<fs::path> missing_folders(const fs::path& directory) {
  std::vector<fs::path> missing;
  std::error_code none;
  for (fs::path path = fs::absolute(directory); path.has_relative_path() && !fs::exists(path, none);
       path = path.parent_path())
    if (path.has_filename()) missing.push_back(path);
  return missing;
}

/// Whether the open file still has its name: another process may have removed it before we locked it.
bool is_named(int descriptor, const fs::path& path) {
  using Status = struct stat;
  Status locked = {}, named = {};
  return ::fstat(descriptor, &locked) == 0 && ::stat(path.c_str(), &named) == 0 && locked.st_ino == named.st_ino &&
         locked.st_dev == named.st_dev;
}

/// Opens the list and locks it.
int open_locked(const fs::path& directory) {
  const fs::path path = directory / kFileList;
  while (true) {
    const int descriptor = ::open(path.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
    if (descriptor < 0) throw unusable(directory, std::generic_category().message(errno));
    const bool is_taken = ::flock(descriptor, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;  // else there are no locks
    if (!is_taken && is_named(descriptor, path)) return descriptor;
    ::close(descriptor);
    if (!is_taken) continue;
    const int process = read_file_list(directory).last_process;
    throw InputError({directory.string(), "output folder",
                      "another run at work in it" + (process == ::getpid() ? " (in this process)"
                                                     : process > 0         ? fmt::format(" (process {})", process)
                                                                           : ""),
                      "that it has ended, or another folder (-o)"});
  }
}

}  // namespace

struct Folder::Impl {
  explicit Impl(fs::path folder) : directory(std::move(folder)), made(missing_folders(directory)) {
    std::error_code error;
    fs::create_directories(directory, error);
    if (error || !fs::is_directory(directory)) throw unusable(directory, error ? error.message() : "a file");
    descriptor = open_locked(directory);
    size_before = size();
    try {
      list = read_file_list(directory);
      if (list.is_being_removed) remove_all();
      if (size_before == 0)
        append(list_text(list.names) + process_line());
      else
        append(process_line(ends_with_line() ? "" : "\n"));
    } catch (...) {
      release();
      throw;
    }
  }
  Impl(const Impl&) = delete;
  ~Impl() { release(); }

  static std::string process_line(const char* before = "") {
    return fmt::format("{}{}{}\n", before, kProcessLine, ::getpid());
  }

  template <typename Names>
  static std::string list_text(const Names& names) {
    std::string text(kFileListHead);
    for (const std::string& name : names) text += name + '\n';
    return text;
  }

  std::size_t size() const {
    using Status = struct stat;
    Status status = {};
    return ::fstat(descriptor, &status) == 0 ? static_cast<std::size_t>(status.st_size) : 0;
  }

  bool ends_with_line() const {
    char last = 0;
    return ::pread(descriptor, &last, 1, static_cast<off_t>(size_before) - 1) == 1 && last == '\n';
  }

  /// Appends all of the text, or throws and leaves the list as it was.
  void append(const std::string& text) const {
    const std::size_t before = size();
    if (::write(descriptor, text.data(), text.size()) == static_cast<ssize_t>(text.size())) return;
    const int reason = errno;
    [[maybe_unused]] const int cut = ::ftruncate(descriptor, static_cast<off_t>(before));
    errno = reason;
    throw InputError({(directory / kFileList).string(), "file", std::generic_category().message(errno),
                      "a folder that can be written, with space left"});
  }

  void release() {
    if (!has_begun) {  // whoever has this file open finds that it has lost its name
      [[maybe_unused]] const int cut = ::ftruncate(descriptor, static_cast<off_t>(size_before));
      std::error_code none;
      if (size_before == 0) fs::remove(directory / kFileList, none);
      for (const fs::path& path : made) fs::remove(path, none);
    }
    ::close(descriptor);
  }

  bool is_there(const std::string& name) const {
    std::error_code none;
    return fs::exists(fs::symlink_status(directory / name, none));
  }

  [[noreturn]] void refuse(const std::string& name) const {
    throw InputError(
        {(directory / name).string(), "file", "one that no run wrote",
         "another folder (-o), or that this file is moved away: a run would replace it, or pass it off as its own"});
  }

  /// Frames count even where the run would write none of their names: readers take all that are there.
  void require_own(const std::vector<std::string>& names) const {
    for (const std::string& name : names)
      if (!list.names.contains(name) && is_there(name)) refuse(name);
    std::vector<std::string> folders = {"frames"};
    if (std::find(names.begin(), names.end(), "sim.pvd") != names.end()) folders.push_back("vtu");
    std::error_code none;
    for (const std::string& folder : folders)
      for (const auto& entry : fs::directory_iterator(directory / folder, none))
        if (const std::string name = folder + "/" + entry.path().filename().string();
            step_of_name(name) >= 0 && !list.names.contains(name))
          refuse(name);
  }

  /// Temporary files of runs that were killed while they wrote.
  std::vector<fs::path> leftovers() const {
    std::vector<fs::path> found;
    std::error_code none;
    for (const std::string folder : {"", "frames/", "vtu/"})
      for (const auto& entry : fs::directory_iterator(directory / folder, none)) {
        const auto [file, process] = file_of_successor(folder + entry.path().filename().string());
        if (list.names.contains(file) && list.processes.contains(process)) found.push_back(entry.path());
      }
    return found;
  }

  /// Removes files of a run and its leftovers; returns how many of them were whole.
  int remove(const std::vector<std::string>& names) const {
    try {
      for (const fs::path& path : leftovers()) fs::remove(path);
      return static_cast<int>(
          std::count_if(names.begin(), names.end(), [&](const auto& name) { return fs::remove(directory / name); }));
    } catch (const fs::filesystem_error& error) {
      throw unusable(directory, error.code().message());
    }
  }

  /// Removes all files of the list, and empties it. A run that is killed meanwhile leaves the rest to the next one.
  int remove_all() {
    const std::set<std::string> there = files_there(directory, list);
    std::vector<std::string> names(there.begin(), there.end());
    // Frames come last, so that no series has links to what is gone.
    std::stable_partition(names.begin(), names.end(), [](const std::string& name) { return step_of_name(name) < 0; });
    const int count = remove(names);
    if (::ftruncate(descriptor, 0) != 0) throw unusable(directory, std::generic_category().message(errno));
    size_before = 0;
    list = {};
    return count;
  }

  void make_frames() const {
    std::error_code error;
    fs::create_directories(directory / "frames", error);
    if (error) throw unusable(directory, error.message());
  }

  fs::path directory;
  std::vector<fs::path> made;
  int descriptor = -1;
  std::size_t size_before = 0;
  bool has_begun = false;
  FileList list;                     ///< as it was when the folder was opened
  std::set<std::string> own;         ///< names of this run, but of frames
  std::deque<std::string> own_last;  ///< of its last frames: no more, as a run may have any number of them
};

Folder::Folder(fs::path directory) : impl_(std::make_unique<Impl>(std::move(directory))) {}
Folder::Folder(Folder&&) noexcept = default;
Folder::~Folder() = default;

const fs::path& Folder::path() const { return impl_->directory; }

bool Folder::has_results() const { return !files_there(impl_->directory, impl_->list).empty(); }

int Folder::begin(const std::vector<std::string>& names) {
  impl_->require_own(names);
  impl_->has_begun = true;
  if (!impl_->list.names.empty()) impl_->append(fmt::format("{}\n", kRemovalLine));
  const int count = impl_->remove_all();
  std::error_code none;
  for (const char* folder : {"frames", "vtu"}) fs::remove(impl_->directory / folder, none);  // if nothing is left there
  impl_->append(Impl::list_text(names) + Impl::process_line());
  impl_->own = {names.begin(), names.end()};
  impl_->make_frames();
  return count;
}

void Folder::resume(const std::vector<std::string>& names, int last_step) {
  impl_->require_own(names);
  impl_->has_begun = true;
  for (const std::string& name : names)
    if (!impl_->list.names.contains(name)) impl_->append(name + '\n');
  impl_->own = {names.begin(), names.end()};
  impl_->make_frames();
  for (const std::string& name : impl_->list.names)
    if (step_of_name(name) == last_step)
      impl_->own_last.push_back(name);
    else if (step_of_name(name) < 0)
      impl_->own.insert(name);
}

int Folder::remove_after(int last_step) {
  std::vector<std::string> stale;
  for (const std::string& name : files_there(impl_->directory, impl_->list))
    if (step_of_name(name) > last_step || name == "summary.json") stale.push_back(name);
  const int count = impl_->remove(stale);
  impl_->list = {};
  return count;
}

bool Folder::owns(const std::string& name) const { return impl_->own.contains(name); }

void Folder::claim(const std::string& name) {
  constexpr std::size_t kLast = 4;
  auto& last = impl_->own_last;
  if (impl_->own.contains(name) || std::find(last.begin(), last.end(), name) != last.end()) return;
  if (impl_->is_there(name)) impl_->refuse(name);
  impl_->append(name + '\n');
  if (step_of_name(name) < 0) {
    impl_->own.insert(name);
  } else {
    last.push_back(name);
    if (last.size() > kLast) last.pop_front();
  }
}

}  // namespace itr::output
