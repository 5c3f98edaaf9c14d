// SPDX-License-Identifier: MIT
// Factors that serve more than one system: what is solved, what is found out about a matrix, what is remembered.
#include "linear/reuse.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "linear_systems.hpp"

namespace itr::linear {
namespace {

constexpr double kAsked = 1e-8;

/// A block large enough for iterations to be cheaper than a factorisation by any engine's count.
const Elastic& block() {
  static const Elastic result = elasticity(3, 9, 0.3);
  return result;
}

/// As stiff as the block in each place but for a fraction of up to `change` of its own.
std::vector<double> changed(const Elastic& system, double change) {
  std::vector<double> values = system.values;
  for (int j = 0; j < system.pattern.order; ++j) values[system.pattern.column_starts[j]] *= 1 + change * (j % 7) / 6;
  return values;
}

std::vector<double> load(int order) {
  std::vector<double> b(order);
  for (int i = 0; i < order; ++i) b[i] = std::sin(i);
  return b;
}

double residual(const SparsityPattern& pattern, const std::vector<double>& values, const std::vector<double>& x,
                const std::vector<double>& b) {
  std::vector<double> r = b;
  for (int j = 0; j < pattern.order; ++j)
    for (int p = pattern.column_starts[j]; p < pattern.column_starts[j + 1]; ++p) {
      const int i = pattern.row_indices[p];
      r[i] -= values[p] * x[j];
      if (i != j) r[j] -= values[p] * x[i];
    }
  double sum = 0, scale = 0;
  for (std::size_t i = 0; i < b.size(); ++i) {
    sum += r[i] * r[i];
    scale += b[i] * b[i];
  }
  return std::sqrt(sum / scale);
}

struct Engines : ::testing::TestWithParam<std::string> {
  Registry registry = full_registry();
  std::unique_ptr<Solver> direct = registry.create(GetParam());
};

std::vector<std::string> direct_solvers() {
  std::vector<std::string> names;
  for (const auto& info : full_registry().list())
    if (info.available && !info.capabilities.iterative) names.push_back(info.name);
  return names;
}

TEST_P(Engines, AnUnchangedMatrixIsFactorisedOnce) {
  ReusingSolver solver(*direct);
  const auto b = load(block().pattern.order);
  std::vector<double> x(b.size()), y(b.size());
  for (auto* solution : {&x, &y}) {
    ASSERT_EQ(solver.analyze(block().pattern, block().hints()), Outcome::ok);
    ASSERT_EQ(solver.factorize(block().values), Outcome::ok);
    ASSERT_EQ(solver.solve(b, *solution, 1, kAsked).outcome, Outcome::ok);
  }
  EXPECT_EQ(x, y);
  EXPECT_EQ(solver.counts().factorizations, 1);
  EXPECT_EQ(solver.counts().solves, 2);
  EXPECT_EQ(solver.counts().reused, 1);
}

TEST_P(Engines, AFactorSolvesWhatIsLikeIt) {
  ReusingSolver solver(*direct);
  const auto b = load(block().pattern.order);
  std::vector<double> x(b.size());
  ASSERT_EQ(solver.analyze(block().pattern, block().hints()), Outcome::ok);
  for (const double change : {0.0, 0.01, 0.02}) {
    const auto values = changed(block(), change);
    const SystemReport report = solver.solve_system(values, b, {kAsked}, x);
    ASSERT_EQ(report.outcome, Outcome::ok) << solver.message();
    const double achieved = residual(block().pattern, values, x, b);
    EXPECT_LE(achieved, kAsked);
    EXPECT_NEAR(report.residual, achieved, 1e-3 * kAsked);
    if (solver.capabilities().tells_definiteness) {
      EXPECT_EQ(report.definiteness, Definiteness::positive);
    }
  }
  EXPECT_EQ(solver.counts().factorizations, 1);
  EXPECT_EQ(solver.counts().reused, 2);
  EXPECT_GT(solver.counts().iterations, 2);
}

TEST_P(Engines, ALooseSolveGoesOnToAllDigits) {
  ReusingSolver at_once(*direct);
  const auto other = registry.create(GetParam());
  ReusingSolver in_two(*other);
  const auto b = load(block().pattern.order);
  std::vector<double> x(b.size());
  const auto solve = [&](ReusingSolver& solver, double change, const Asked& asked) {
    const auto values = changed(block(), change);
    EXPECT_EQ(solver.analyze(block().pattern, block().hints()), Outcome::ok);
    EXPECT_EQ(solver.solve_system(values, b, asked, x).outcome, Outcome::ok);
    return residual(block().pattern, values, x, b);
  };
  for (ReusingSolver* solver : {&at_once, &in_two}) solve(*solver, 0, {kAsked});
  EXPECT_LE(solve(at_once, 0.02, {kAsked}), kAsked);
  const double loose = solve(in_two, 0.02, {.residual = kAsked, .loose = 1e-3});
  EXPECT_GT(loose, kAsked);
  EXPECT_LE(loose, 1e-3);
  EXPECT_LT(in_two.counts().iterations, at_once.counts().iterations);
  EXPECT_LE(solve(in_two, 0.02, {.residual = kAsked, .goes_on = true}), kAsked);
  EXPECT_LE(in_two.counts().iterations, at_once.counts().iterations + 2);
  EXPECT_EQ(in_two.counts().factorizations, 1);
  EXPECT_EQ(in_two.counts().solves, 2);
  EXPECT_EQ(in_two.counts().reused, 1);
}

TEST_P(Engines, AGrownPatternDoesNotMatter) {
  ReusingSolver solver(*direct);
  const int n = block().pattern.order;
  // A spring between the first and the last unknown, as a contact would be.
  Elastic touched = block();
  auto& [order, starts, rows] = touched.pattern;
  rows.insert(rows.begin() + starts[1], n - 1);
  touched.values.insert(touched.values.begin() + starts[1], -1);
  for (int j = 1; j <= n; ++j) ++starts[j];
  touched.values[0] += 1;
  touched.values.back() += 1;
  const auto b = load(n);
  std::vector<double> x(n);
  for (const Elastic* system : {&block(), const_cast<const Elastic*>(&touched)}) {
    ASSERT_EQ(solver.analyze(system->pattern, system->hints()), Outcome::ok);
    ASSERT_EQ(solver.solve_system(system->values, b, {kAsked}, x).outcome, Outcome::ok);
  }
  EXPECT_LE(residual(touched.pattern, touched.values, x, b), kAsked);
  EXPECT_EQ(solver.counts().factorizations, 1);
}

/// The matrix has a negative eigenvalue in a direction that neither the right-hand side nor the rest of it knows of.
TEST_P(Engines, IndefinitenessIsSeenInEveryDirection) {
  ReusingSolver solver(*direct);
  Elastic system = block();
  auto& [order, starts, rows] = system.pattern;
  ++order;  // one more unknown, on its own
  starts.push_back(starts.back() + 1);
  rows.push_back(order - 1);
  system.values.push_back(1);
  std::vector<double> b = load(order), x(order);
  b.back() = 0;
  ASSERT_EQ(solver.analyze(system.pattern, {}), Outcome::ok);
  ASSERT_EQ(solver.solve_system(system.values, b, {kAsked}, x).outcome, Outcome::ok);
  system.values.back() = -1e-3;
  const SystemReport loose = solver.solve_system(system.values, b, {.residual = kAsked, .loose = 1e-2}, x);
  if (loose.outcome != Outcome::ok) {
    EXPECT_EQ(loose.outcome, Outcome::not_positive_definite);
  }
  // A loose solve before does not hide it.
  const SystemReport report = solver.solve_system(system.values, b, {.residual = kAsked, .goes_on = true}, x);
  if (solver.capabilities().tells_definiteness || !solver.capabilities().indefinite) {
    EXPECT_EQ(report.outcome, Outcome::not_positive_definite);
    EXPECT_EQ(report.definiteness, Definiteness::indefinite);
  } else {
    EXPECT_EQ(report.outcome, Outcome::ok);
    EXPECT_EQ(report.definiteness, Definiteness::unknown);
  }
  if (!solver.capabilities().indefinite) return;
  EXPECT_EQ(solver.solve_system(system.values, b, {.residual = kAsked, .if_indefinite = true}, x).outcome, Outcome::ok);
  EXPECT_LE(residual(system.pattern, system.values, x, b), kAsked);
}

/// A system that was solved by iterations has no factor of its own, and a question alone does not count as a solve.
TEST_P(Engines, WhatAMatrixIsCanBeAskedAlone) {
  ReusingSolver solver(*direct);
  const auto b = load(block().pattern.order);
  std::vector<double> x(b.size());
  ASSERT_EQ(solver.analyze(block().pattern, block().hints()), Outcome::ok);
  ASSERT_EQ(solver.solve_system(block().values, b, {kAsked}, x).outcome, Outcome::ok);
  EXPECT_TRUE(solver.has_factor());
  const auto values = changed(block(), 0.01);
  const SystemReport report = solver.solve_system(values, b, {kAsked}, {});
  EXPECT_EQ(report.outcome, Outcome::ok);
  EXPECT_EQ(report.definiteness, Definiteness::positive);
  EXPECT_EQ(solver.counts().solves, 1);
  EXPECT_EQ(solver.counts().factorizations, 1);
  EXPECT_FALSE(solver.has_factor());
  EXPECT_EQ(solver.solve(b, x, 1, kAsked).outcome, Outcome::failed) << "the factor is of another matrix";
  ASSERT_EQ(solver.factorize(values), Outcome::ok);
  EXPECT_EQ(solver.solve(b, x, 1, kAsked).outcome, Outcome::ok);
  EXPECT_LE(residual(block().pattern, values, x, b), kAsked);
}

/// Iterations over the factor of an indefinite matrix prove nothing.
TEST_P(Engines, NoFactorOfAnIndefiniteMatrixIsKept) {
  if (!direct->capabilities().tells_definiteness || !direct->capabilities().indefinite) return;
  ReusingSolver solver(*direct);
  Elastic system = block();
  for (int j = 0; j < 6; ++j) system.values[system.pattern.column_starts[j]] *= -1;
  const auto b = load(system.pattern.order);
  std::vector<double> x(b.size());
  ASSERT_EQ(solver.analyze(system.pattern, system.hints()), Outcome::ok);
  ASSERT_EQ(solver.solve_system(system.values, b, {.residual = kAsked, .if_indefinite = true}, x).outcome, Outcome::ok);
  EXPECT_FALSE(solver.record().matrix);
  EXPECT_EQ(solver.solve_system(changed(system, 1e-4), b, {kAsked}, x).definiteness, Definiteness::indefinite);
}

TEST_P(Engines, AMatrixThatIsNotLikeItIsFactorised) {
  ReusingSolver solver(*direct);
  const auto b = load(block().pattern.order);
  std::vector<double> x(b.size());
  ASSERT_EQ(solver.analyze(block().pattern, block().hints()), Outcome::ok);
  for (const double change : {0.0, 1e6}) {
    const auto values = changed(block(), change);
    ASSERT_EQ(solver.solve_system(values, b, {kAsked}, x).outcome, Outcome::ok);
    EXPECT_LE(residual(block().pattern, values, x, b), kAsked);
  }
  EXPECT_EQ(solver.counts().factorizations, 2);
}

/// A solver that goes on from a record solves the next systems with the same bits.
TEST_P(Engines, ARecordIsAllThatMatters) {
  const auto b = load(block().pattern.order);
  const auto other = registry.create(GetParam());
  ReusingSolver through(*direct), resumed(*other);
  const auto solve = [&](ReusingSolver& solver, double change) {
    std::vector<double> x(b.size());
    EXPECT_EQ(solver.analyze(block().pattern, block().hints()), Outcome::ok);
    EXPECT_EQ(solver.solve_system(changed(block(), change), b, {kAsked}, x).outcome, Outcome::ok);
    return x;
  };
  for (const double change : {0.0, 0.01, 0.02}) solve(through, change);
  ASSERT_TRUE(through.record().matrix);
  resumed.restore(through.record());
  EXPECT_EQ(resumed.counts().factorizations, 0) << "of a system that was counted before";
  for (const double change : {0.03, 0.04, 5.0, 5.1}) {
    const auto before = through.counts();
    EXPECT_EQ(solve(through, change), solve(resumed, change)) << change;
    EXPECT_EQ(through.counts().factorizations - 1, resumed.counts().factorizations) << change;
    EXPECT_GE(through.counts().solves, before.solves);
  }
}

INSTANTIATE_TEST_SUITE_P(Table, Engines, ::testing::ValuesIn(direct_solvers()),
                         [](const auto& info) { return as_test_name(info.param); });

TEST(Record, IsEmptyWhereAnOrderCameFromAnEarlierPattern) {
  Registry registry = full_registry();
  if (!registry.is_ready("cholmod"))
    GTEST_SKIP() << "a machine without CHOLMOD does without: " << registry.find("cholmod").reason;
  const auto direct = registry.create("cholmod");
  ReusingSolver solver(*direct);
  for (const bool may_keep_order : {false, true}) {
    AnalyzeHints hints = block().hints();
    hints.may_keep_order = may_keep_order;
    Elastic system = block();
    if (may_keep_order) {  // another pattern, and so far off that it is factorised
      system.pattern.row_indices.insert(system.pattern.row_indices.begin() + system.pattern.column_starts[1],
                                        system.pattern.order - 1);
      system.values.insert(system.values.begin() + system.pattern.column_starts[1], 1e-9);
      for (int j = 1; j <= system.pattern.order; ++j) ++system.pattern.column_starts[j];
      system.values = changed(system, 1e6);
    }
    const auto b = load(system.pattern.order);
    std::vector<double> x(b.size());
    ASSERT_EQ(solver.analyze(system.pattern, hints), Outcome::ok);
    ASSERT_EQ(solver.solve_system(system.values, b, {kAsked}, x).outcome, Outcome::ok);
    EXPECT_EQ(solver.record().matrix == nullptr, may_keep_order);
  }
  EXPECT_EQ(solver.counts().factorizations, 2);
}

}  // namespace
}  // namespace itr::linear
