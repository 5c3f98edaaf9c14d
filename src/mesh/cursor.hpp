// SPDX-License-Identifier: MIT
// Reads numbers and lines of mesh files, and bytes from a position on.
#pragma once

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "core/quoted.hpp"
#include "itr/core.hpp"

namespace itr {

/// The number that a word is, which may begin with a plus sign; nothing if it is another word.
template <typename T>
std::optional<T> number_of(std::string_view word) {
  const std::string_view digits = word.substr(word.starts_with('+') ? 1 : 0);
  T value{};
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  return error == std::errc() && end == digits.data() + digits.size() ? std::optional(value) : std::nullopt;
}

/// The first characters of what was found, for a message.
inline std::string quoted_start(std::string_view text) { return quoted(text.substr(0, 40)); }

/// Lines of a text, one after another.
class Lines {
 public:
  Lines(std::string_view bytes, const std::filesystem::path& file) : rest_(bytes), file_(file) {}

  /// Goes to the next line; false: there is none.
  bool next() {
    if (rest_.empty()) return false;
    const auto end = std::min(rest_.find('\n'), rest_.size());
    text = rest_.substr(0, end);
    rest_.remove_prefix(std::min(end + 1, rest_.size()));
    ++number;
    return true;
  }

  std::string_view text;
  int number = 0;

  [[noreturn]] void fail(const std::string& found, const std::string& expected) const { fail_at(number, found, expected); }
  [[noreturn]] void fail_at(int line, const std::string& found, const std::string& expected) const {
    throw InputError({file_.string(), "line " + std::to_string(line), found, expected});
  }

 private:
  std::string_view rest_;
  const std::filesystem::path& file_;
};

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
    if (end == bytes_.npos) fail(quoted_start(bytes_.substr(position_)), "a name between double quotes");
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
    if (found != "$End" + name) fail(quoted_start(found), "$End" + name);
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
    if (const std::optional<T> value = number_of<T>(token)) return *value;
    position_ = begin;
    fail(token.empty() ? "the end of the file" : quoted_start(token), "a number");
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
