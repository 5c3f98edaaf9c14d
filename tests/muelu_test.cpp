// SPDX-License-Identifier: MIT
// Multigrid of Trilinos on elasticity: iterations by mesh and near-null space, and the truth about indefinite matrices.
#include <gtest/gtest.h>

#include "linear_systems.hpp"

namespace itr::linear {
namespace {

class MueluTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (const auto info = registry.find("belos:muelu"); !info.available)
      GTEST_SKIP() << "a machine without Trilinos does without: " << info.reason;
  }
  Registry registry = full_registry();
};

TEST_F(MueluTest, NeedsNotMoreIterationsOnFinerMeshesAndFewerWithRigidModes) {
  const auto iterations = [&](const Elastic& system, const AnalyzeHints& hints) {
    const auto solver = registry.create("belos:muelu");
    const std::vector<double> b(system.pattern.order, 1.0);
    std::vector<double> x(b.size());
    EXPECT_EQ(solver->analyze(system.pattern, hints), Outcome::ok);
    EXPECT_EQ(solver->factorize(system.values), Outcome::ok) << solver->message();
    EXPECT_EQ(solver->solve(b, x, 1, 1e-9).outcome, Outcome::ok) << solver->message();
    return solver->statistics().iterations;
  };
  const Elastic coarse = elasticity(2, 24, 0.3), fine = elasticity(2, 48, 0.3);
  const int on_coarse = iterations(coarse, coarse.hints()), on_fine = iterations(fine, fine.hints());
  EXPECT_GT(on_coarse, 0);
  EXPECT_LE(on_fine, 1.5 * on_coarse);
  EXPECT_LT(on_fine, iterations(fine, {.block_size = 2, .dofs = fine.dofs}));
}

/// Less `shift` on the diagonal.
Elastic shifted(Elastic system, double shift) {
  for (int j = 0; j < system.pattern.order; ++j) system.values[system.pattern.column_starts[j]] -= shift;
  system.full.diagonal().array() -= shift;
  return system;
}

TEST_F(MueluTest, TellsAnIndefiniteMatrixWhoseDiagonalIsPositive) {
  const Elastic stiff = elasticity(2, 24, 0.3);
  const Eigen::SelfAdjointEigenSolver<Dense> eigen(stiff.full);
  const Eigen::VectorXd first = eigen.eigenvectors().col(0);
  const std::vector<double> b(first.data(), first.data() + first.size());  // all of it along the negative direction
  std::vector<double> x(b.size());
  for (const double side : {0.9, 1.1}) {
    const Elastic system = shifted(stiff, side * eigen.eigenvalues()[0]);
    const auto solver = registry.create("belos:muelu");
    ASSERT_EQ(solver->analyze(system.pattern, system.hints()), Outcome::ok);
    ASSERT_EQ(solver->factorize(system.values), Outcome::ok) << solver->message();
    EXPECT_EQ(solver->solve(b, x, 1, 1e-8).outcome, side < 1 ? Outcome::ok : Outcome::not_positive_definite);
  }
}

}  // namespace
}  // namespace itr::linear
