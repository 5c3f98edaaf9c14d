// SPDX-License-Identifier: MIT
// Conjugate gradients over a preconditioner: how they end, what they tell, and that they can go on.
#include "linear/conjugate_gradients.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "linear/system.hpp"
#include "linear_systems.hpp"

namespace itr::linear {
namespace {

using End = ConjugateGradients::End;

/// A block, with the diagonal as preconditioner.
struct Block : ::testing::Test {
  Elastic block = elasticity(3, 4, 0.3);
  std::vector<double> b = std::vector<double>(block.pattern.order);
  ConjugateGradients iteration;
  Block() {
    for (std::size_t i = 0; i < b.size(); ++i) b[i] = std::sin(static_cast<double>(i));
  }
  SystemView system() const { return {block.pattern, block.values, b}; }
  ConjugateGradients::Preconditioner diagonal() const {
    return [this](std::span<const double> r, std::span<double> z) {
      for (std::size_t i = 0; i < r.size(); ++i) z[i] = r[i] / std::abs(block.values[block.pattern.column_starts[i]]);
      return true;
    };
  }
};

TEST_F(Block, ReachesWhatIsAskedAndGoesOn) {
  ASSERT_TRUE(iteration.begin(system(), diagonal()));
  ASSERT_EQ(iteration.run(system(), diagonal(), 1e-3, 1000), End::reached);
  EXPECT_LE(iteration.residual(), 1e-3);
  EXPECT_GT(iteration.residual(), 1e-8);
  const int first = iteration.iterations();
  ASSERT_EQ(iteration.run(system(), diagonal(), 1e-8, 1000), End::reached);
  EXPECT_LE(iteration.residual(), 1e-8);
  EXPECT_GT(iteration.iterations(), 0);
  EXPECT_GT(first, 0);
  std::vector<double> r = b;
  for (int j = 0; j < block.pattern.order; ++j)
    for (int p = block.pattern.column_starts[j]; p < block.pattern.column_starts[j + 1]; ++p) {
      const int i = block.pattern.row_indices[p];
      r[i] -= block.values[p] * iteration.solution()[j];
      if (i != j) r[j] -= block.values[p] * iteration.solution()[i];
    }
  EXPECT_NEAR(ConjugateGradients::norm(r) / ConjugateGradients::norm(b), iteration.residual(), 1e-12);
}

TEST_F(Block, EndsWhereItIsTooSlow) {
  ASSERT_TRUE(iteration.begin(system(), diagonal()));
  EXPECT_EQ(iteration.run(system(), diagonal(), 1e-8, 3), End::too_slow);
  EXPECT_EQ(iteration.iterations(), 3);
  EXPECT_EQ(iteration.run(system(), diagonal(), 1e-8, 0), End::too_slow);
  EXPECT_EQ(iteration.iterations(), 0);
}

TEST_F(Block, EndsWhereThePreconditionerFails) {
  const auto fails = [](std::span<const double>, std::span<double>) { return false; };
  EXPECT_FALSE(iteration.begin(system(), fails));
  ASSERT_TRUE(iteration.begin(system(), diagonal()));
  EXPECT_EQ(iteration.run(system(), fails, 1e-8, 100), End::too_slow);
}

/// The right-hand side has no part in the direction of negative curvature.
TEST_F(Block, MeetsNegativeCurvatureInEveryDirection) {
  ++block.pattern.order;
  block.pattern.column_starts.push_back(block.pattern.column_starts.back() + 1);
  block.pattern.row_indices.push_back(block.pattern.order - 1);
  block.values.push_back(1);
  b.push_back(0);
  Registry registry;
  const auto solver = registry.create("eigen:ldlt");
  ASSERT_EQ(solver->analyze(block.pattern, {}), Outcome::ok);
  ASSERT_EQ(solver->factorize(block.values), Outcome::ok);
  const auto factor = [&](std::span<const double> r, std::span<double> z) {
    return solver->solve(r, z, 1, 1).outcome == Outcome::ok;
  };
  block.values.back() = -1e-3;
  ASSERT_TRUE(iteration.begin(system(), factor));
  EXPECT_EQ(iteration.run(system(), factor, 1e-8, 1000), End::negative);
}

TEST(System, HasNoSolutionOfAnIndefiniteMatrixUnlessAsked) {
  const SystemReport factorized{.definiteness = Definiteness::indefinite, .negative_eigenvalues = 2};
  const auto solve = [] { return SolveReport{Outcome::ok, 1e-9}; };
  const SystemReport refused = with_solution(factorized, {.residual = 1e-8}, solve);
  EXPECT_EQ(refused.outcome, Outcome::not_positive_definite);
  EXPECT_EQ(refused.negative_eigenvalues, 2);
  EXPECT_TRUE(std::isinf(refused.residual));
  const SystemReport solved = with_solution(factorized, {.residual = 1e-8, .if_indefinite = true}, solve);
  EXPECT_EQ(solved.outcome, Outcome::ok);
  EXPECT_EQ(solved.residual, 1e-9);
  EXPECT_EQ(solved.definiteness, Definiteness::indefinite);
}

TEST(System, IsDescribedByItsFactorisation) {
  Registry registry;
  const Elastic block = elasticity(2, 3, 0.3);
  for (const char* name : {"eigen:llt", "eigen:ldlt", "eigen:lu"}) {
    const auto solver = registry.create(name);
    ASSERT_EQ(solver->analyze(block.pattern, {}), Outcome::ok);
    const SystemReport positive = describe(solver->factorize(block.values), *solver);
    const bool tells = solver->capabilities().tells_definiteness;
    EXPECT_EQ(positive.definiteness, tells ? Definiteness::positive : Definiteness::unknown) << name;
    auto values = block.values;
    values[0] = -values[0];
    const SystemReport indefinite = describe(solver->factorize(values), *solver);
    EXPECT_EQ(indefinite.definiteness, tells ? Definiteness::indefinite : Definiteness::unknown) << name;
    EXPECT_EQ(indefinite.negative_eigenvalues, std::string(name) == "eigen:ldlt" ? 1 : 0) << name;
  }
}

}  // namespace
}  // namespace itr::linear
