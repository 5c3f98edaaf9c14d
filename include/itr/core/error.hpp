// SPDX-License-Identifier: MIT
// The three kinds of failure: a user's mistake throws InputError; a numerical outcome is an enum in a summary; a broken
// invariant of ours throws InternalError through ITR_CHECK (core/check.hpp).
#pragma once

#include <stdexcept>
#include <string>

namespace itr {

/// A mistake in something that a user handed in: says the file, the place in it (a JSON pointer, a line), what was
/// found and what was expected. The command prints it and ends with status 2.
class InputError : public std::runtime_error {
 public:
  struct Parts {
    std::string file;      ///< path of the offending file; empty where there is none
    std::string place;     ///< JSON pointer, "line 12", option name
    std::string found;     ///< what is there
    std::string expected;  ///< what would have been right
  };
  explicit InputError(Parts parts);
  const Parts& parts() const { return parts_; }

 private:
  Parts parts_;
};

/// A broken invariant of the library itself.
class InternalError : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

}  // namespace itr
