// SPDX-License-Identifier: MIT
#pragma once

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>
#include <string_view>

#include "core/quoted.hpp"
#include "itr/core/error.hpp"

namespace itr {

/// Position in the bytes of a file, reading numbers as the file writes them.
class Cursor {
 public:
  Cursor(std::string_view bytes, const std::filesystem::path& file) : bytes_(bytes), file_(file) {}

  bool binary = false;

  /// Next word of text, empty at the end.
  std::string_view word() {
    skip_space();
    const std::size_t begin = position_;
    while (position_ < bytes_.size() && !is_space(bytes_[position_])) ++position_;
    return bytes_.substr(begin, position_ - begin);
  }

  /// Next text between double quotes.
  std::string quoted_text() {
    skip_space();
    const auto end = position_ < bytes_.size() && bytes_[position_] == '"' ? bytes_.find('"', position_ + 1) : bytes_.npos;
    if (end == bytes_.npos) fail(quoted(bytes_.substr(position_, 40)), "a name between double quotes");
    const std::string text(bytes_.substr(position_ + 1, end - position_ - 1));
    position_ = end + 1;
    return text;
  }

  /// The word that comes next.
  std::string_view peek() {
    const std::size_t begin = position_;
    const std::string_view next = word();
    position_ = begin;
    return next;
  }

  /// Goes on behind the next empty line.
  void skip_paragraph() {
    const auto end = bytes_.find("\n\n", position_);
    position_ = end == bytes_.npos ? bytes_.size() : end + 2;
  }

  bool is_at_end() const { return position_ >= bytes_.size(); }

  /// Binary data begins after the end of the line.
  void end_line() {
    while (position_ < bytes_.size() && bytes_[position_] != '\n') ++position_;
    position_ = std::min(position_ + 1, bytes_.size());
  }

  std::int64_t small() { return binary ? raw<std::int32_t>() : text<std::int64_t>(); }  ///< C int
  std::int64_t size() {                                                                 ///< C size_t
    const std::int64_t value = binary ? raw<std::int64_t>() : text<std::int64_t>();
    if (value < 0) fail("the number " + std::to_string(value), "one >= 0");
    return value;
  }
  double real() { return binary ? raw<double>() : text<double>(); }

  /// A number of things of which each takes at least one byte: more than there are bytes is a broken file.
  std::size_t count(std::int64_t value) {
    if (value < 0 || static_cast<std::uint64_t>(value) > bytes_.size() - position_)
      fail("a count of " + std::to_string(value), "at most as many as the rest of the file can hold");
    return static_cast<std::size_t>(value);
  }

  void skip_section(const std::string& name) {
    const auto end = bytes_.find("$End" + name, position_);
    if (end == std::string_view::npos) fail("no $End" + name, "it before the end of the file");
    position_ = end;
    word();
  }

  void expect_end(const std::string& name) {
    const std::string_view found = word();
    if (found != "$End" + name) fail(quoted(found.substr(0, 40)), "$End" + name);
  }

  /// A number as it is in memory, little endian.
  template <typename T>
  T raw() {
    if (bytes_.size() - position_ < sizeof(T)) fail("the end of the file", "more data");
    T value;
    std::memcpy(&value, bytes_.data() + position_, sizeof(T));
    position_ += sizeof(T);
    return value;
  }

  /// The next word as a number.
  template <typename T>
  T text() {
    skip_space();
    const std::size_t begin = position_;
    const std::string_view token = word();
    const std::string_view digits = token.substr(token.starts_with('+') ? 1 : 0);
    T value{};
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error != std::errc() || end != digits.data() + digits.size()) {
      position_ = begin;
      fail(token.empty() ? "the end of the file" : quoted(token.substr(0, 40)), "a number");
    }
    return value;
  }

  [[noreturn]] void fail(const std::string& found, const std::string& expected) const {
    const auto lines = std::count(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(position_), '\n');
    const std::string place = binary ? "byte " + std::to_string(position_) : "line " + std::to_string(lines + 1);
    throw InputError({file_.string(), place, found, expected});
  }

 private:
  static bool is_space(char c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; }

  void skip_space() {
    while (position_ < bytes_.size() && is_space(bytes_[position_])) ++position_;
  }

  std::string_view bytes_;
  const std::filesystem::path& file_;
  std::size_t position_ = 0;
};

}  // namespace itr
