// SPDX-License-Identifier: MIT
// What stands behind a Solver: one factorisation, no residuals. CheckedSolver (checked_solver.cpp) adds what all engines
// need: finite input, trivial orders, achieved residuals, refinement.
#pragma once

#include <memory>
#include <span>
#include <string>

#include "itr/linear/solver.hpp"

namespace itr::linear {

class Engine {
 public:
  virtual ~Engine() = default;
  virtual Outcome analyze(const SparsityPattern& pattern, const AnalyzeHints& hints) = 0;
  virtual Outcome factorize(std::span<const double> values) = 0;
  virtual Outcome solve(std::span<const double> B, std::span<double> X, int columns) = 0;
  virtual std::string message() const { return {}; }
};

std::unique_ptr<Engine> make_eigen_ldlt();
std::unique_ptr<Engine> make_eigen_llt();
std::unique_ptr<Engine> make_eigen_lu();
std::unique_ptr<Engine> make_eigen_cg();
std::unique_ptr<Engine> make_dense();

/// The Solver that users see, over an engine.
std::unique_ptr<Solver> make_checked_solver(std::string name, Capabilities capabilities, std::unique_ptr<Engine> engine);

}  // namespace itr::linear
