// SPDX-License-Identifier: MIT
#include "frame_links.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cstdint>
#include <system_error>

#include "files.hpp"
#include "itr/core.hpp"

namespace itr::output {

namespace {

namespace fs = std::filesystem;

constexpr std::size_t kPage = 4096;  // bytes that the system copies at once, and that no signal divides
constexpr std::size_t kChecksum = 4, kMessageHead = 4, kContinuation = kMessageHead + 16;
constexpr const char* kChunkMark = "OCHK";
constexpr std::size_t kRoom = kPage - 4 - kChecksum - kContinuation;  // for links, the continuation is kept free
constexpr std::uint64_t kRootHeader = 64, kFramesHeader = 256, kNowhere = ~std::uint64_t{0};
enum Message : unsigned char { kFill = 0, kLinkInfo = 2, kLink = 6, kGroupInfo = 10, kContinue = 16 };

/// `value` in so many bytes, the lowest first.
std::string number(std::uint64_t value, int bytes) {
  std::string text;
  for (int i = 0; i < bytes; ++i) text += static_cast<char>(value >> (8 * i) & 255);
  return text;
}

/// The checksum of HDF5's metadata: lookup3 by Bob Jenkins, public domain, of bytes in order, from 0.
std::uint32_t checksum(const std::string& bytes) {
  struct Round {
    int to, from, turn;
  };
  constexpr std::array<Round, 6> kMix = {{{0, 2, 4}, {1, 0, 6}, {2, 1, 8}, {0, 2, 16}, {1, 0, 19}, {2, 1, 4}}};
  constexpr std::array<Round, 7> kEnd = {
      {{2, 1, 14}, {0, 2, 11}, {1, 0, 25}, {2, 1, 16}, {0, 2, 4}, {1, 0, 14}, {2, 1, 24}}};
  constexpr std::size_t kBlock = 12;
  std::array<std::uint32_t, 3> sums;
  sums.fill(0xdeadbeef + static_cast<std::uint32_t>(bytes.size()));
  for (std::size_t start = 0; start < bytes.size(); start += kBlock) {
    for (std::size_t i = start; i < std::min(start + kBlock, bytes.size()); ++i)
      sums[(i - start) / 4] += static_cast<std::uint32_t>(static_cast<unsigned char>(bytes[i])) << (8 * ((i - start) % 4));
    if (start + kBlock >= bytes.size()) break;
    for (const auto& [to, from, turn] : kMix) {
      sums[to] -= sums[from];
      sums[to] ^= std::rotl(sums[from], turn);
      sums[from] += sums[3 - to - from];
    }
  }
  for (const auto& [to, from, turn] : kEnd) {
    sums[to] ^= sums[from];
    sums[to] -= std::rotl(sums[from], turn);
  }
  return sums[2];
}

std::string with_checksum(const std::string& bytes) { return bytes + number(checksum(bytes), kChecksum); }

std::string message(Message type, const std::string& data) {
  return number(type, 1) + number(data.size(), 2) + number(0, 1) + data;
}

/// Links are messages of the header itself: there is neither a heap nor a tree of names.
std::string group_messages() {
  return message(kLinkInfo, number(0, 2) + number(kNowhere, 8) + number(kNowhere, 8)) + message(kGroupInfo, number(0, 2));
}

std::string continuation(std::size_t page) { return message(kContinue, number(page * kPage, 8) + number(kPage, 8)); }

std::string hard_link(const std::string& name, std::uint64_t header) {
  return message(kLink, number(1, 1) + number(0, 1) + number(name.size(), 1) + name + number(header, 8));
}

/// A link to the root of another file.
std::string external_link(const std::string& name, const std::string& file) {
  constexpr int kHasType = 8, kExternal = 64;
  const std::string target = number(0, 1) + file + '\0' + "/" + '\0';
  return message(kLink, number(1, 1) + number(kHasType, 1) + number(kExternal, 1) + number(name.size(), 1) + name +
                            number(target.size(), 2) + target);
}

std::string object_header(const std::string& messages) {
  return with_checksum("OHDR" + number(2, 1) + number(1, 1) + number(messages.size(), 2) + messages);
}

/// `continued`: whether the group goes on in the next page.
std::string link_page(std::size_t page, const std::string& messages, bool continued) {
  std::string bytes = kChunkMark + messages;
  if (continued) bytes += continuation(page + 1);
  const std::size_t rest = kPage - kChecksum - bytes.size();
  bytes += rest < kMessageHead ? std::string(rest, '\0') : message(kFill, std::string(rest - kMessageHead, '\0'));
  return with_checksum(bytes);
}

/// Page 0: what a reader begins with.
std::string first_page(std::size_t pages) {
  const std::string superblock =
      with_checksum("\x89HDF\r\n\x1a\n" + number(2, 1) + number(8, 1) + number(8, 1) + number(0, 1) + number(0, 8) +
                    number(kNowhere, 8) + number(pages * kPage, 8) + number(kRootHeader, 8));
  std::string page(kPage, '\0');
  const auto put = [&](std::size_t place, const std::string& bytes) { std::copy(bytes.begin(), bytes.end(), &page[place]); };
  put(0, superblock);
  put(kRootHeader, object_header(group_messages() + hard_link("frames", kFramesHeader)));
  put(kFramesHeader, object_header(group_messages() + continuation(1)));
  return page;
}

std::string link_to(const std::string& file) { return external_link(fs::path(file).stem().string(), file); }

}  // namespace

FrameLinks::FrameLinks(fs::path path, const std::vector<std::string>& files) : path_(std::move(path)) {
  std::string pages;
  for (const std::string& file : files) {
    const std::string link = link_to(file);
    if (messages_.size() + link.size() > kRoom) {
      pages += link_page(last_page_++, messages_, true);
      messages_.clear();
    }
    length_before_ = messages_.size();
    messages_ += link;
  }
  write_file(path_, first_page(last_page_ + 1) + pages + link_page(last_page_, messages_, false));
  descriptor_ = ::open(path_.c_str(), O_WRONLY | O_CLOEXEC);
  if (descriptor_ < 0)
    throw InputError({path_.string(), "file", std::generic_category().message(errno), "a file that can be written"});
}

FrameLinks::~FrameLinks() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

void FrameLinks::append(const std::string& file) {
  const std::string link = link_to(file);
  if (messages_.size() + link.size() <= kRoom) {
    write(last_page_, link_page(last_page_, messages_ + link, false));
    length_before_ = messages_.size();
    messages_ += link;
    return;
  }
  // The new page comes first: nothing links it yet.
  write(last_page_ + 1, link_page(last_page_ + 1, link, false));
  write(0, first_page(last_page_ + 2));
  write(last_page_, link_page(last_page_, messages_, true));
  ++last_page_;
  messages_ = link;
  length_before_ = 0;
}

void FrameLinks::drop_last() {
  const std::string kept = messages_.substr(0, length_before_);
  write(last_page_, link_page(last_page_, kept, false));
  messages_ = kept;
}

void FrameLinks::write(std::size_t page, const std::string& bytes) {
  ssize_t written = 0;
  do {
    written = ::pwrite(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(page * kPage));
  } while (written < 0 && errno == EINTR);
  if (written == static_cast<ssize_t>(bytes.size())) return;
  const int reason = written < 0 ? errno : ENOSPC;
  throw InputError(
      {path_.string(), "file", std::generic_category().message(reason), "a folder that can be written, with space left"});
}

}  // namespace itr::output
