// SPDX-License-Identifier: MIT
// One suite over every solver that is there: right answers against dense long double, failures as the right outcome.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>
#include <sstream>
#include <thread>

#include "itr/core.hpp"
#include "itr/solver.hpp"
#include "linear_systems.hpp"

namespace itr::linear {
namespace {

/// Springs between neighbours of a grid with `dim` unknowns a node, all directions coupled: like elasticity.
Dense springs(int dim, int side, double stiff) {
  int nodes = 1;
  for (int d = 0; d < dim; ++d) nodes *= side;
  Dense A = Dense::Identity(dim * nodes, dim * nodes) * 0.01;
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  int stride = 1;
  for (int d = 0; d < dim; ++d, stride *= side)
    for (int a = 0; a + stride < nodes; ++a) {
      Eigen::VectorXd g = Eigen::VectorXd::Zero(dim * nodes);
      for (int c = 0; c < dim; ++c) {
        const double direction = normal(random);
        g[dim * a + c] = direction;
        g[dim * (a + stride) + c] = -direction;
      }
      A += (a % 17 == 0 ? stiff : 1.0) * g * g.transpose();
    }
  return A;
}

/// One solver, as it comes or with one of its orderings.
struct Case {
  BackendInfo info;
  SolverOptions options;
};
void PrintTo(const Case& which, std::ostream* out) {
  *out << which.info.name;
  for (const auto& [key, value] : which.options) *out << " " << key << "=" << value;
}

class EverySolver : public ::testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    const BackendInfo& info = GetParam().info;
    if (!info.available) GTEST_SKIP() << "a machine without " << info.name << " does without: " << info.reason;
    solver_ = create();
  }
  static std::unique_ptr<Solver> create() { return full_registry().create(GetParam().info.name, GetParam().options); }
  std::unique_ptr<Solver> solver_;

  void expect_solves(const System& system, double tolerance, int columns = 1, bool analyze = true, AnalyzeHints hints = {}) {
    const int n = system.pattern.order;
    Eigen::MatrixXd B =
        Eigen::MatrixXd::NullaryExpr(n, columns, [](Eigen::Index i, Eigen::Index j) { return std::cos(1.0 + i + 3 * j); });
    Eigen::MatrixXd X(n, columns);
    if (analyze) {
      ASSERT_EQ(solver_->analyze(system.pattern, hints), Outcome::ok) << solver_->message();
    }
    ASSERT_EQ(solver_->factorize(system.values), Outcome::ok) << solver_->message();
    const auto report =
        solver_->solve({B.data(), std::size_t(B.size())}, {X.data(), std::size_t(X.size())}, columns, tolerance);
    ASSERT_EQ(report.outcome, Outcome::ok) << report.relative_residual;
    double worst = 0;
    for (int c = 0; c < columns; ++c) {
      const auto residual =
          (B.col(c).cast<long double>() - system.full.cast<long double>() * X.col(c).cast<long double>()).norm();
      worst = std::max(worst, double(residual) / B.col(c).norm());
    }
    EXPECT_LE(worst, 2 * tolerance);
    EXPECT_NEAR(report.relative_residual, worst, 1e-3 * worst + 1e-13);  // what it reports is true
    if (n == 0) return;
    // The error that this residual allows, against the dense solution in long double.
    const Eigen::Matrix<long double, -1, -1> inverse = system.full.cast<long double>().partialPivLu().inverse();
    for (int c = 0; c < columns; ++c) {
      const auto error = (X.col(c).cast<long double>() - inverse * B.col(c).cast<long double>()).norm();
      EXPECT_LE(double(error), 2 * tolerance * double(inverse.norm()) * B.col(c).norm());
    }
  }
  bool is_cholesky() const { return !solver_->capabilities().indefinite && !solver_->capabilities().iterative; }
};

TEST_P(EverySolver, SolvesElasticity) {
  expect_solves(from_dense(springs(2, 9, 1)), 1e-10);
  expect_solves(from_dense(springs(3, 4, 1)), 1e-10);
  for (const double poisson_ratio : {0.3, 0.49})
    for (const auto& [dim, side] : {std::pair{2, 12}, std::pair{3, 5}}) {
      const Elastic system = elasticity(dim, side, poisson_ratio);
      expect_solves(system, 1e-9, 1, true, system.hints());
      expect_solves(system, 1e-9);  // without hints
    }
}

/// Libraries take other ways through large systems than through small ones.
TEST_P(EverySolver, SolvesMoreThanAThousandUnknowns) {
  const Elastic system = elasticity(2, 27, 0.3);
  const int n = system.pattern.order;
  ASSERT_GT(n, 1024);
  ASSERT_EQ(solver_->analyze(system.pattern, system.hints()), Outcome::ok) << solver_->message();
  if (is_cholesky()) {
    auto indefinite = system.values;
    indefinite[system.pattern.column_starts[n / 2]] = -1e3;
    EXPECT_EQ(solver_->factorize(indefinite), Outcome::not_positive_definite);
  }
  std::vector<double> b(2 * n, 1.0), x(b.size());
  for (int i = 0; i < n; ++i) b[n + i] = std::cos(i);
  for (int i = 0; i < 2; ++i) {
    ASSERT_EQ(solver_->factorize(system.values), Outcome::ok) << solver_->message();
    EXPECT_EQ(solver_->solve(b, x, 2, 1e-9).outcome, Outcome::ok) << solver_->message();
  }
  const Eigen::Map<const Dense> B(b.data(), n, 2), X(x.data(), n, 2);
  EXPECT_LE((B - system.full * X).colwise().norm().cwiseQuotient(B.colwise().norm()).maxCoeff(), 2e-9);
}

TEST_P(EverySolver, SolvesMassMatrices) { expect_solves(from_dense(tridiagonal(60, 4, 1)), 1e-12); }

TEST_P(EverySolver, ReachesOrReportsStiffSystems) {
  const System system = from_dense(springs(2, 6, 1e10));
  std::vector<double> b(system.pattern.order, 1.0), x(system.pattern.order);
  ASSERT_EQ(solver_->analyze(system.pattern, {}), Outcome::ok);
  ASSERT_EQ(solver_->factorize(system.values), Outcome::ok);
  const auto report = solver_->solve(b, x, 1, 1e-8);
  const Eigen::Map<Eigen::VectorXd> solution(x.data(), x.size());
  const double residual = double((Eigen::VectorXd::Ones(x.size()).cast<long double>() -
                                  system.full.cast<long double>() * solution.cast<long double>())
                                     .norm()) /
                          std::sqrt(x.size());
  // A residual in double precision cannot be known better than to the round-off of A x.
  const double round_off = 1e-15 * system.full.norm() * solution.norm() / std::sqrt(x.size());
  EXPECT_NEAR(report.relative_residual, residual, 0.1 * residual + round_off);
  EXPECT_EQ(report.outcome == Outcome::ok, report.relative_residual <= 1e-8);
}

TEST_P(EverySolver, NeverSolvesIndefiniteSystemsSilently) {
  Dense A = tridiagonal(20, 4, 1);
  A(7, 7) = -9;
  const System system = from_dense(A);
  if (solver_->capabilities().indefinite) {
    expect_solves(system, 1e-10);
    EXPECT_EQ(solver_->statistics().negative_pivots, solver_->capabilities().tells_definiteness ? 1 : 0);
    return;
  }
  ASSERT_EQ(solver_->analyze(system.pattern, {}), Outcome::ok);
  EXPECT_EQ(solver_->factorize(system.values), Outcome::not_positive_definite);
}

TEST_P(EverySolver, ReportsSingularSystems) {
  Dense A = tridiagonal(30, 2, -1);
  A(0, 0) = A(29, 29) = 1;  // a free chain: constants are in the null space
  const System system = from_dense(A);
  std::vector<double> b(30, 1.0), x(30);
  ASSERT_EQ(solver_->analyze(system.pattern, {}), Outcome::ok);
  const Outcome outcome = solver_->factorize(system.values);
  if (outcome == Outcome::ok) {  // round-off hid it: the residual must not
    EXPECT_NE(solver_->solve(b, x, 1, 1e-8).outcome, Outcome::ok);
  }
}

TEST_P(EverySolver, DoesNotTakeSoftBesideStiffForSingular) {
  Dense A = Dense::Zero(9, 9);
  for (int i = 0; i < 9; i += 3) A.block(i, i, 3, 3) = tridiagonal(3, 4, 1) * std::pow(10.0, 3 * (i - 3));
  const System system = from_dense(A);
  const Eigen::VectorXd b = A * Eigen::VectorXd::Ones(9);
  std::vector<double> x(9);
  ASSERT_EQ(solver_->analyze(system.pattern, {}), Outcome::ok);
  ASSERT_EQ(solver_->factorize(system.values), Outcome::ok) << solver_->message();
  ASSERT_EQ(solver_->solve({b.data(), 9}, x, 1, 1e-8).outcome, Outcome::ok) << solver_->message();
  if (solver_->capabilities().iterative) return;  // the residual of the whole says nothing about the soft part
  for (const double value : x) EXPECT_NEAR(value, 1, 1e-12);
}

TEST_P(EverySolver, GoesOnAfterAFailedFactorization) {
  const System good = from_dense(tridiagonal(20, 4, 1));
  const std::vector<double> zeros(good.values.size(), 0.0);
  ASSERT_EQ(solver_->analyze(good.pattern, {}), Outcome::ok);
  const Outcome outcome = solver_->factorize(zeros);
  EXPECT_TRUE(outcome == Outcome::singular || outcome == Outcome::not_positive_definite) << to_string(outcome);
  EXPECT_FALSE(solver_->message().empty());
  EXPECT_EQ(solver_->message().find("status 0"), std::string::npos) << solver_->message();
  std::vector<double> b(20, 1.0), x(20);
  EXPECT_EQ(solver_->solve(b, x, 1, 1e-8).outcome, Outcome::failed);  // there is nothing to solve with
  expect_solves(good, 1e-12, 1, false);
}

TEST_P(EverySolver, TellsStatisticsAtAnyTime) {
  const auto expect_sane = [&](const char* when) {
    const Statistics s = solver_->statistics();
    for (const double figure : {s.factor_nonzeros, s.factor_bytes, s.largest_bytes, s.flops}) {
      EXPECT_GE(figure, 0) << when;
      EXPECT_LE(figure, 1e9) << when;
    }
    EXPECT_EQ(s.iterations, 0) << when;
  };
  expect_sane("before anything");
  const System system = from_dense(tridiagonal(20, 4, 1));
  ASSERT_EQ(solver_->analyze(system.pattern, {}), Outcome::ok);
  expect_sane("after the analysis");
  EXPECT_NE(solver_->factorize(std::vector<double>(system.values.size(), 0.0)), Outcome::ok);
  expect_sane("after a failed factorisation");
  ASSERT_EQ(solver_->factorize(system.values), Outcome::ok);
  expect_sane("after a factorisation");
}

TEST_P(EverySolver, MeasuresResidualsWhoseSquaresLeaveTheRangeOfDouble) {
  const System system = from_dense(tridiagonal(20, 4, 1));
  ASSERT_EQ(solver_->analyze(system.pattern, {}), Outcome::ok);
  ASSERT_EQ(solver_->factorize(system.values), Outcome::ok);
  for (const double size : {1e-190, 1e190}) {
    std::vector<double> b(20, size), x(20, 0.0);
    const auto report = solver_->solve(b, x, 1, 1e-10);
    if (solver_->capabilities().iterative) {  // may give up there, but must not claim success
      if (report.outcome != Outcome::ok) continue;
    }
    EXPECT_EQ(report.outcome, Outcome::ok) << size << ": " << solver_->message();
    for (int i = 0; i < 20; ++i) {
      const double Ax = 4 * x[i] + (i > 0 ? x[i - 1] : 0) + (i < 19 ? x[i + 1] : 0);
      EXPECT_NEAR(Ax / size, 1, 1e-9);
    }
    EXPECT_LE(report.relative_residual, 1e-10);
    EXPECT_GT(report.relative_residual, 0);
  }
}

TEST_P(EverySolver, RefusesWhatIsNotFinite) {
  System system = from_dense(tridiagonal(10, 4, 1));
  ASSERT_EQ(solver_->analyze(system.pattern, {}), Outcome::ok);
  auto broken = system.values;
  broken[3] = std::nan("");
  EXPECT_EQ(solver_->factorize(broken), Outcome::non_finite);
  ASSERT_EQ(solver_->factorize(system.values), Outcome::ok);
  std::vector<double> b(10, HUGE_VAL), x(10);
  EXPECT_EQ(solver_->solve(b, x, 1, 1e-8).outcome, Outcome::non_finite);
}

TEST_P(EverySolver, SolvesEmptyAndSingleSystems) {
  const System empty = from_dense(Dense(0, 0));
  ASSERT_EQ(solver_->analyze(empty.pattern, {}), Outcome::ok);
  ASSERT_EQ(solver_->factorize(empty.values), Outcome::ok);
  EXPECT_EQ(solver_->solve({}, {}, 1, 1e-8).outcome, Outcome::ok);
  expect_solves(from_dense(Dense::Constant(1, 1, 3.0)), 1e-14);
}

TEST_P(EverySolver, ReusesAndChangesPatterns) {
  System system = from_dense(springs(2, 5, 1));
  expect_solves(system, 1e-10);
  for (double& v : system.values) v *= 3;
  system.full *= 3;
  expect_solves(system, 1e-10, 1, false);
  expect_solves(from_dense(tridiagonal(11, 5, 1)), 1e-12);
}

/// Contacts come and go: entries between nodes that are far from each other.
TEST_P(EverySolver, MayKeepAnOrderAndForgetsItWhenAsked) {
  const Elastic body = elasticity(3, 4, 0.3);
  const int n = body.pattern.order;
  const auto with_contacts = [&](int first, int contacts) {
    Dense full = body.full;
    for (int c = 0; c < contacts; ++c) {
      const int i = (first + 7 * c) % n, j = (first + 7 * c + n / 2) % n;
      full(i, j) = full(j, i) = -0.1;
      full(i, i) += 0.1;
      full(j, j) += 0.1;
    }
    return from_dense(full);
  };
  const auto solution = [&](Solver& solver, const System& system, bool may_keep_order) {
    std::vector<double> b(n, 1.0), x(n);
    EXPECT_EQ(solver.analyze(system.pattern, {.may_keep_order = may_keep_order}), Outcome::ok) << solver.message();
    EXPECT_EQ(solver.factorize(system.values), Outcome::ok) << solver.message();
    EXPECT_EQ(solver.solve(b, x, 1, 1e-9).outcome, Outcome::ok) << solver.message();
    return x;
  };
  const System few = with_contacts(3, 2), more = with_contacts(3, 5), others = with_contacts(20, n / 2);
  solution(*solver_, few, false);
  for (const System* system : {&more, &few, &others, &more}) expect_solves(*system, 1e-9, 2, true, {.may_keep_order = true});
  expect_solves(from_dense(tridiagonal(11, 5, 1)), 1e-12, 1, true, {.may_keep_order = true});  // of another order
  solution(*solver_, few, true);
  const auto by_kept_order = solution(*solver_, more, true), by_new_order = solution(*create(), more, false);
  EXPECT_EQ(solution(*solver_, more, false), by_new_order);  // to the last bit: as after a resume
  const auto ordering = GetParam().options.find("ordering");
  if (solver_->capabilities().keeps_order && (ordering == GetParam().options.end() || ordering->second != "natural")) {
    EXPECT_NE(by_kept_order, by_new_order);  // it is kept
  }
}

/// METIS costs several factorisations by AMD's order: it is tried once that order has served for many.
TEST(Cholmod, OrdersByMetisWhereAStepTakesManyFactorizations) {
  Registry registry = full_registry();
  const BackendInfo info = registry.find("cholmod:supernodal");
  if (!info.available) GTEST_SKIP() << "a machine without " << info.name << " does without: " << info.reason;
  const System system = laplacian(22);
  auto indefinite = system.values;
  for (double& value : indefinite) value = value < 0 ? 100 * value : value;  // refused at the first pivots
  SparsityPattern with_contact = system.pattern;
  with_contact.row_indices.insert(with_contact.row_indices.begin() + with_contact.column_starts[1],
                                  system.pattern.order - 1);
  for (int column = 1; column <= with_contact.order; ++column) ++with_contact.column_starts[column];
  const auto flops_after = [&](int factorizations, const SolverOptions& options = {}) {
    const auto solver = registry.create("cholmod:supernodal", options);
    EXPECT_EQ(solver->analyze(system.pattern, {}), Outcome::ok);
    for (int k = 0; k < factorizations; ++k) EXPECT_EQ(solver->factorize(indefinite), Outcome::not_positive_definite);
    EXPECT_EQ(solver->analyze(with_contact, {.may_keep_order = true}), Outcome::ok);
    return solver->statistics().flops;
  };
  EXPECT_LT(flops_after(10), 0.8 * flops_after(9));
  EXPECT_EQ(flops_after(10, {{"ordering", "amd"}}), flops_after(9, {{"ordering", "amd"}}));
}

/// Resumed runs and runs on more threads end with the same bits. Some orderings use threads and random numbers.
TEST_P(EverySolver, FindsTheSameBitsTwice) {
  const bool dense = GetParam().info.name == "dense";
  const System system = laplacian(dense ? 8 : 20);
  std::vector<double> b(system.pattern.order, 1.0), first(b.size()), second(b.size());
  for (std::vector<double>* solution : {&first, &second}) {
    if (solution == &second) solver_ = create();
    ASSERT_EQ(solver_->analyze(system.pattern, {}), Outcome::ok) << solver_->message();
    ASSERT_EQ(solver_->factorize(system.values), Outcome::ok) << solver_->message();
    ASSERT_EQ(solver_->solve(b, *solution, 1, 1e-8).outcome, Outcome::ok) << solver_->message();
  }
  EXPECT_EQ(first, second);
}

TEST_P(EverySolver, SolvesSeveralRightHandSidesAndNone) {
  expect_solves(from_dense(springs(2, 6, 1)), 1e-10, 5);
  EXPECT_EQ(solver_->solve({}, {}, 0, 1e-10).outcome, Outcome::ok);
}

TEST_P(EverySolver, TwoInTwoThreadsDoNotDisturbEachOther) {
  const auto work = [&](int n) {
    const auto solver = create();
    const System system = from_dense(tridiagonal(n, 4, 1));
    std::vector<double> b(n, 1.0), x(n);
    for (int i = 0; i < 50; ++i)
      if (solver->analyze(system.pattern, {}) != Outcome::ok || solver->factorize(system.values) != Outcome::ok ||
          solver->solve(b, x, 1, 1e-10).outcome != Outcome::ok)
        return false;
    return true;
  };
  bool first = false, second = false;
  std::thread a([&] { first = work(100); }), b([&] { second = work(157); });
  a.join();
  b.join();
  EXPECT_TRUE(first && second);
}

/// All rows of the table; present ones also with each ordering that they list.
std::vector<Case> cases() {
  std::vector<Case> all;
  for (const auto& info : full_registry().list()) {
    all.push_back({info, {}});
    std::istringstream options(info.options);
    for (std::string option; options >> option;) {
      if (option.rfind("ordering=", 0) != 0) continue;
      std::istringstream values(option.substr(option.find('=') + 1));
      for (std::string value; std::getline(values, value, '|');) all.push_back({info, {{"ordering", value}}});
    }
  }
  return all;
}
std::string test_name(const ::testing::TestParamInfo<Case>& info) {
  return as_test_name(::testing::PrintToString(info.param));
}
INSTANTIATE_TEST_SUITE_P(Table, EverySolver, ::testing::ValuesIn(cases()), test_name);

// Sanitizers end the program at such a request.
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
TEST(Solver, ReportsThatMemoryIsOut) {
  constexpr int kOrder = 5'000'000;  // dense: more bytes than a process can address, whatever the system overcommits
  SparsityPattern pattern;
  pattern.order = kOrder;
  for (int i = 0; i <= kOrder; ++i) pattern.column_starts.push_back(i);
  pattern.row_indices.assign(pattern.column_starts.begin(), pattern.column_starts.end() - 1);
  const std::vector<double> ones(kOrder, 1.0);
  const auto solver = Registry().create("dense");
  ASSERT_EQ(solver->analyze(pattern, {}), Outcome::ok);
  EXPECT_EQ(solver->factorize(ones), Outcome::out_of_memory);
}
#endif

}  // namespace
}  // namespace itr::linear
