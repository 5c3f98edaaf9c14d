// SPDX-License-Identifier: MIT
// The interface that a program implements to bring its own solver: factorise and solve. make_checked_solver adds the checks
// of input, trivial orders, residuals and refinement.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "itr/linear/solver.hpp"

namespace itr::linear {

class Engine {
 public:
  virtual ~Engine() = default;
  /// Sets an option. Returns false if the engine has no such option or refuses the value.
  virtual bool set_option(const std::string& key, const std::string& value) = 0;
  virtual Outcome analyze(const SparsityPattern& pattern, const AnalyzeHints& hints) = 0;
  virtual Outcome factorize(std::span<const double> values) = 0;
  /// B and X hold columns of length n one after another and do not overlap.
  virtual Outcome solve(std::span<const double> B, std::span<double> X, int columns) = 0;
  virtual Statistics statistics() const = 0;
  virtual std::string message() const = 0;  ///< of the last outcome that was not ok; may be empty
};

/// Makes the checked Solver over an engine.
std::unique_ptr<Solver> make_checked_solver(std::string name, Capabilities capabilities, std::unique_ptr<Engine> engine);

}  // namespace itr::linear
