// SPDX-License-Identifier: MIT
#include "series_text.hpp"

#include <algorithm>

#include "core/timer.hpp"

namespace itr::output {

namespace {

constexpr double kPeriod = 30;   // [s] between replacements of the file that are due to time
constexpr double kShare = 1e-3;  // of the time, that these may take at most

std::string without_end(std::string text) {
  if (!text.empty() && text.back() == '\n') text.pop_back();
  return text;
}

}  // namespace

SeriesText::SeriesText(std::filesystem::path path, const std::string& head, std::string tail)
    : path_(std::move(path)),
      part_path_(part_name(path_.string())),
      tail_(std::move(tail)),
      parts_(part_path_, 0),
      last_write_(seconds_now()) {
  parts_.append(without_end(head));
}

SeriesText::~SeriesText() {
  std::error_code none;
  std::filesystem::remove(part_path_, none);
}

void SeriesText::append(std::string part) {
  const std::size_t length = parts_.size();
  parts_.append(without_end(std::move(part)));
  length_before_ = length;
  ++count_;
}

void SeriesText::add(std::string part) {
  append(std::move(part));
  const double pause = std::max(kPeriod, write_seconds_ / kShare);
  if (count_ >= 2 * written_ || seconds_now() - last_write_ >= pause) write();
}

void SeriesText::drop_last() {
  parts_.shorten(length_before_);
  --count_;
  written_ = 0;  // the file names what is taken back: the next part replaces it
}

void SeriesText::write() {
  const double start = seconds_now();
  Successor file(path_);
  file.copy(part_path_, parts_.size());
  file.write(tail_);
  file.replace();
  written_ = count_;
  last_write_ = seconds_now();
  write_seconds_ = last_write_ - start;
}

}  // namespace itr::output
