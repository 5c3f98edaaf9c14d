// SPDX-License-Identifier: MIT
#include "files.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <system_error>

#include "itr/core/error.hpp"

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
bool replace(const fs::path& temporary, const fs::path& path) {
#ifdef RENAME_EXCHANGE
  if (::renameat2(AT_FDCWD, temporary.c_str(), AT_FDCWD, path.c_str(), RENAME_EXCHANGE) == 0) {
    ::unlink(temporary.c_str());
    return true;
  }
#endif
  return ::rename(temporary.c_str(), path.c_str()) == 0;
}

}  // namespace

void write_file(const fs::path& path, std::string_view bytes, Durability durability) {
  const fs::path temporary = path.string() + ".tmp";
  const int descriptor = ::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (descriptor < 0) fail(path);
  const bool is_written = write_all(descriptor, bytes) && (durability == Durability::process || ::fsync(descriptor) == 0);
  const int reason = errno;
  const bool is_closed = ::close(descriptor) == 0;  // some file systems report a full disk only here
  if (is_written && is_closed && replace(temporary, path)) return;
  if (!is_written) errno = reason;
  const int first_reason = errno;
  ::unlink(temporary.c_str());
  errno = first_reason;
  fail(path);
}

void sync(const fs::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) fail(path);
  const bool is_synced = ::fsync(descriptor) == 0 || errno == EINVAL;  // a file system that knows no such thing
  const int reason = errno;
  ::close(descriptor);
  errno = reason;
  if (!is_synced) fail(path);
}

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
