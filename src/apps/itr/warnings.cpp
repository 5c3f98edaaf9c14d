// SPDX-License-Identifier: MIT
#include "warnings.hpp"

#include <spdlog/spdlog.h>

#include "output/warnings.hpp"

namespace itr::cli {

namespace {
constexpr int kMostOfAKind = 3;
}

void Warnings::add(std::string_view text) {
  const int times = ++said_[output::kind_of_warning(text)];
  if (times <= kMostOfAKind)
    spdlog::warn("warning: {}{}", text, times == kMostOfAKind ? " (more of this kind are counted, not said)" : "");
  if (writer_)
    writer_->warn(std::string(text));
  else
    early_.emplace_back(text);
}

void Warnings::set_writer(output::Writer* writer) {
  writer_ = writer;
  for (const std::string& text : early_) writer_->warn(text);
  early_.clear();
}

}  // namespace itr::cli
