// SPDX-License-Identifier: MIT
// Warnings as `run` says them, for the results' files too.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "itr/output/writer.hpp"

namespace itr::cli {

class Warnings {
 public:
  /// Says it after "warning:", the first times that there is one of its kind, and passes it on to the writer.
  void add(std::string_view text);
  /// Passes warnings on to the writer, also those from before it was there.
  void set_writer(output::Writer* writer);

 private:
  std::vector<std::string> early_;
  std::map<std::string, int> said_;  ///< how often, by kind
  output::Writer* writer_ = nullptr;
};

}  // namespace itr::cli
