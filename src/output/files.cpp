// SPDX-License-Identifier: MIT
#include "files.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <regex>
#include <system_error>
#include <utility>

#include "itr/core.hpp"

namespace itr::output {

namespace {

namespace fs = std::filesystem;

/// With errno as the reason.
[[noreturn]] void fail(const fs::path& path) {
  throw InputError(
      {path.string(), "file", std::generic_category().message(errno), "a folder that can be written, with space left"});
}

/// Whether all bytes were written; errno says why not.
bool write_all(int descriptor, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return false;
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

/// Puts a file in the place of another. Where there is one already they change places: ext4 writes what replaces a file to
/// the disk at once (auto_da_alloc), which takes longer than a small step.
bool exchange(const fs::path& temporary, const fs::path& path) {
#ifdef RENAME_EXCHANGE
  if (::renameat2(AT_FDCWD, temporary.c_str(), AT_FDCWD, path.c_str(), RENAME_EXCHANGE) == 0) {
    ::unlink(temporary.c_str());
    return true;
  }
#endif
  return ::rename(temporary.c_str(), path.c_str()) == 0;
}

/// Calls fsync or syncfs for what has this name.
void sync_by(int (*call)(int), const fs::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) fail(path);
  const bool is_synced = call(descriptor) == 0 || errno == EINVAL;  // a file system that knows no such thing
  const int reason = errno;
  ::close(descriptor);
  errno = reason;
  if (!is_synced) fail(path);
}

}  // namespace

Successor::Successor(fs::path path) : path_(std::move(path)) {
  constexpr int kMostTries = 1000;  // each name that is taken already is somebody's file
  for (int i = 0; i < kMostTries && descriptor_ < 0; ++i) {
    temporary_ = fmt::format("{}.{}-{}.tmp", path_.string(), ::getpid(), i);
    descriptor_ = ::open(temporary_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor_ < 0 && errno != EEXIST) break;
  }
  if (descriptor_ < 0) fail(path_);
}

Successor::~Successor() {
  if (descriptor_ >= 0) ::close(descriptor_);
  if (!temporary_.empty()) ::unlink(temporary_.c_str());
}

void Successor::write(std::string_view bytes) {
  if (!write_all(descriptor_, bytes)) fail(path_);
}

void Successor::copy(const fs::path& source, std::size_t size) {
  constexpr std::size_t kPart = 1 << 16;
  const int from = ::open(source.c_str(), O_RDONLY | O_CLOEXEC);
  if (from < 0) fail(source);
  std::string part(std::min(size, kPart), '\0');
  bool is_copied = true;
  while (is_copied && size > 0) {
    const ssize_t count = ::read(from, part.data(), std::min(size, part.size()));
    if (count < 0 && errno == EINTR) continue;
    if (count == 0) errno = EIO;  // shorter than its writer says
    is_copied = count > 0 && write_all(descriptor_, std::string_view(part).substr(0, static_cast<std::size_t>(count)));
    if (is_copied) size -= static_cast<std::size_t>(count);
  }
  const int reason = errno;
  ::close(from);
  errno = reason;
  if (!is_copied) fail(path_);
}

void Successor::replace(Durability durability) {
  if (durability == Durability::power && ::fsync(descriptor_) != 0) fail(path_);
  if (::close(std::exchange(descriptor_, -1)) != 0) fail(path_);  // some file systems report a full disk only here
  if (!exchange(temporary_, path_)) fail(path_);
  temporary_.clear();
}

std::pair<std::string, int> file_of_successor(const std::string& name) {
  static const std::regex pattern("(.+)\\.([0-9]{1,9})-[0-9]+\\.tmp");
  std::smatch parts;
  if (!std::regex_match(name, parts, pattern)) return {};
  return {parts[1], std::stoi(parts[2])};
}

void write_file(const fs::path& path, std::string_view bytes, Durability durability) {
  Successor file(path);
  file.write(bytes);
  file.replace(durability);
}

void sync(const fs::path& path) { sync_by(::fsync, path); }

void sync_file_system(const fs::path& folder) { sync_by(::syncfs, folder); }

LineFile::LineFile(fs::path path, std::size_t keep) : path_(std::move(path)), size_(keep) {
  descriptor_ = ::open(path_.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC, 0666);
  if (descriptor_ < 0) fail(path_);
  std::error_code error;
  const auto found = fs::file_size(path_, error);
  const bool is_usable = !error && found >= keep && ::ftruncate(descriptor_, static_cast<off_t>(keep)) == 0 &&
                         ::lseek(descriptor_, static_cast<off_t>(keep), SEEK_SET) >= 0;
  if (is_usable) return;
  ::close(descriptor_);
  throw InputError({path_.string(), "length", error ? error.message() : std::to_string(found) + " bytes",
                    "at least " + std::to_string(keep) + ", as when the state was saved"});
}

LineFile::~LineFile() { ::close(descriptor_); }

void LineFile::append(std::string line) {
  line += '\n';
  if (write_all(descriptor_, line)) {
    size_ += line.size();
    return;
  }
  const int reason = errno;
  shorten(size_);
  errno = reason;
  fail(path_);
}

void LineFile::shorten(std::size_t size) {
  if (::ftruncate(descriptor_, static_cast<off_t>(size)) != 0 ||
      ::lseek(descriptor_, static_cast<off_t>(size), SEEK_SET) < 0)
    fail(path_);
  size_ = size;
}

}  // namespace itr::output
