// SPDX-License-Identifier: MIT
// Checks around every solver's engine: analyses that are not repeated, refinement and its count of iterations.
#include <gtest/gtest.h>

#include "itr/solver.hpp"
#include "linear_systems.hpp"

namespace itr::linear {
namespace {

/// Counts what reaches the engine.
class CountingEngine final : public Engine {
 public:
  explicit CountingEngine(int& analyses) : analyses_(analyses) {}
  bool set_option(const std::string&, const std::string&) override { return false; }
  Outcome analyze(const SparsityPattern&, const AnalyzeHints&) override { return ++analyses_, Outcome::ok; }
  Outcome factorize(std::span<const double>) override { return Outcome::ok; }
  Outcome solve(std::span<const double>, std::span<double>, int) override { return Outcome::failed; }
  Statistics statistics() const override { return {}; }
  std::string message() const override { return "never solves"; }

 private:
  int& analyses_;
};

TEST(CheckedSolver, AnalysesAPatternOnceUnlessItMayUsePositions) {
  const SparsityPattern one = from_dense(tridiagonal(5, 4, 1)).pattern, other = from_dense(tridiagonal(6, 4, 1)).pattern;
  for (const bool iterative : {false, true}) {
    int analyses = 0;
    const auto solver =
        make_checked_solver("counting", {.iterative = iterative}, std::make_unique<CountingEngine>(analyses));
    for (const auto& pattern : {one, one, other, other, one}) EXPECT_EQ(solver->analyze(pattern, {}), Outcome::ok);
    EXPECT_EQ(analyses, iterative ? 5 : 3);
  }
}

TEST(CheckedSolver, AnalysesAnewWhereAnOldOrderMayNotServe) {
  const SparsityPattern one = from_dense(tridiagonal(5, 4, 1)).pattern, other = from_dense(tridiagonal(6, 4, 1)).pattern;
  for (const bool keeps : {false, true}) {
    int analyses = 0;
    const auto solver = make_checked_solver("counting", {.keeps_order = keeps}, std::make_unique<CountingEngine>(analyses));
    const auto analyze = [&](const SparsityPattern& pattern, bool may_keep) {
      EXPECT_EQ(solver->analyze(pattern, {.may_keep_order = may_keep}), Outcome::ok);
      return analyses;
    };
    EXPECT_EQ(analyze(one, false), 1);
    EXPECT_EQ(analyze(one, true), 1);
    EXPECT_EQ(analyze(other, true), 2);
    EXPECT_EQ(analyze(other, true), 2);
    EXPECT_EQ(analyze(other, false), keeps ? 3 : 2);  // the analysis that it has may depend on `one`
    EXPECT_EQ(analyze(other, false), keeps ? 3 : 2);
  }
}

/// Gains a tenth with each solve, which takes seven iterations.
class SlowEngine final : public Engine {
 public:
  bool set_option(const std::string&, const std::string&) override { return false; }
  Outcome analyze(const SparsityPattern&, const AnalyzeHints&) override { return Outcome::ok; }
  Outcome factorize(std::span<const double>) override { return Outcome::ok; }
  Outcome solve(std::span<const double> B, std::span<double> X, int) override {
    for (std::size_t i = 0; i < B.size(); ++i) X[i] = 0.9 * B[i];
    return Outcome::ok;
  }
  Statistics statistics() const override { return {.iterations = 7}; }
  std::string message() const override { return {}; }
};

TEST(CheckedSolver, CountsTheIterationsOfRefinementsToo) {
  const System system = from_dense(Dense::Identity(5, 5));
  const auto solver = make_checked_solver("slow", {.iterative = true}, std::make_unique<SlowEngine>());
  const std::vector<double> b(5, 1.0);
  std::vector<double> x(5);
  ASSERT_EQ(solver->analyze(system.pattern, {}), Outcome::ok);
  ASSERT_EQ(solver->factorize(system.values), Outcome::ok);
  EXPECT_EQ(solver->statistics().iterations, 0);
  const auto iterations_to = [&](double residual) {
    EXPECT_EQ(solver->solve(b, x, 1, residual).outcome, Outcome::ok);
    return solver->statistics().iterations;
  };
  EXPECT_EQ(iterations_to(0.2), 7);
  EXPECT_EQ(iterations_to(2e-3), 21);
}

}  // namespace
}  // namespace itr::linear
