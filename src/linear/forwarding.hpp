// SPDX-License-Identifier: MIT
#pragma once

#include "itr/solver.hpp"

namespace itr::linear {

/// A solver that wraps others. It answers for its name in use, capabilities, statistics and message with those of the solver
/// that is now active.
class Forwarding : public Solver {
 public:
  std::string_view name_in_use() const override { return current().name_in_use(); }
  Capabilities capabilities() const override { return current().capabilities(); }
  Statistics statistics() const override { return current().statistics(); }
  std::string message() const override { return current().message(); }

 protected:
  virtual const Solver& current() const = 0;
};

}  // namespace itr::linear
