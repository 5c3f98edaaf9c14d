// SPDX-License-Identifier: MIT
#pragma once

#include "itr/linear/solver.hpp"

namespace itr::linear {

/// A solver around others: what it is and says is what the one that answers now is and says.
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
