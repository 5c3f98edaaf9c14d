// SPDX-License-Identifier: MIT
// One suite over every solver that is there: right answers against dense long double, failures as the right outcome.
#include <gtest/gtest.h>

#include <unistd.h>

#include <Eigen/Dense>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <numeric>
#include <random>
#include <sstream>
#include <thread>

#include "itr/core/error.hpp"
#include "itr/linear/dump.hpp"
#include "itr/linear/registry.hpp"

namespace itr::linear {
namespace {

using Dense = Eigen::MatrixXd;

struct System {
  SparsityPattern pattern;
  std::vector<double> values;
  Dense full;
};

/// Lower triangle of a dense symmetric matrix; exact zeros off the diagonal are not stored.
System from_dense(const Dense& full) {
  System system;
  system.full = full;
  system.pattern.order = static_cast<int>(full.rows());
  system.pattern.column_starts.push_back(0);
  for (int j = 0; j < full.rows(); ++j) {
    for (int i = j; i < full.rows(); ++i)
      if (i == j || full(i, j) != 0) {
        system.pattern.row_indices.push_back(i);
        system.values.push_back(full(i, j));
      }
    system.pattern.column_starts.push_back(static_cast<int>(system.values.size()));
  }
  return system;
}

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

Dense tridiagonal(int n, double diagonal, double off) {
  Dense A = Dense::Identity(n, n) * diagonal;
  for (int i = 0; i + 1 < n; ++i) A(i, i + 1) = A(i + 1, i) = off;
  return A;
}

/// What `itr solvers` lists; here the program is the test, which lets modules start MPI.
Registry full_registry() {
  Registry registry;
  registry.allow_mpi_start();
  return registry;
}

/// A matrix with what Newton tells of it.
struct Elastic : System {
  int block_size = 1;
  std::vector<int> dofs;
  std::vector<double> coordinates;
  AnalyzeHints hints() const { return {.block_size = block_size, .dofs = dofs, .coordinates = coordinates}; }
};

/// Linear elasticity on a grid of `side`^dim nodes, each cell cut into dim! simplices along its diagonal (Kuhn). Nodes on
/// the first face are held, those on the last one in their first component only.
Elastic elasticity(int dim, int side, double poisson_ratio) {
  const double mu = 1 / (2 * (1 + poisson_ratio)), lambda = poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio));
  const double h = 1.0 / (side - 1);
  int nodes = 1;
  for (int d = 0; d < dim; ++d) nodes *= side;
  const auto grid = [&](int node) {
    Eigen::VectorXi index(dim);
    for (int d = 0; d < dim; ++d, node /= side) index[d] = node % side;
    return index;
  };
  const auto node_at = [&](const Eigen::VectorXi& index) {
    int node = 0;
    for (int d = dim - 1; d >= 0; --d) node = node * side + index[d];
    return node;
  };
  Elastic result;
  result.block_size = dim;
  std::vector<int> unknown(dim * nodes, -1);
  for (int i = 0; i < dim * nodes; ++i) {
    const Eigen::VectorXi index = grid(i / dim);
    if (index[0] == 0 || (index[0] == side - 1 && i % dim == 0)) continue;
    unknown[i] = static_cast<int>(result.dofs.size());
    result.dofs.push_back(i);
    for (int d = 0; d < dim; ++d) result.coordinates.push_back(h * index[d]);
  }
  std::map<std::pair<int, int>, double> entries;  // (column, row) of the lower triangle
  for (int cell = 0; cell < nodes; ++cell) {
    if ((grid(cell).array() == side - 1).any()) continue;
    std::vector<int> order(dim);
    std::iota(order.begin(), order.end(), 0);
    do {
      std::vector<int> corner = {cell};
      Eigen::VectorXi index = grid(cell);
      Dense edges(dim, dim);
      for (int k = 0; k < dim; ++k) {
        ++index[order[k]];
        corner.push_back(node_at(index));
        edges.col(k) = h * (index - grid(cell)).cast<double>();
      }
      Dense gradients(dim, dim + 1);  // of the shape functions
      gradients.rightCols(dim) = edges.inverse().transpose();
      gradients.col(0) = -gradients.rightCols(dim).rowwise().sum();
      const double volume = std::abs(edges.determinant()) / (dim == 2 ? 2 : 6);
      for (int a = 0; a <= dim; ++a)
        for (int b = 0; b <= dim; ++b) {
          const Eigen::VectorXd p = gradients.col(a), q = gradients.col(b);
          const Dense block =
              volume * (lambda * p * q.transpose() + mu * q * p.transpose() + mu * p.dot(q) * Dense::Identity(dim, dim));
          for (int i = 0; i < dim; ++i)
            for (int j = 0; j < dim; ++j) {
              const int row = unknown[dim * corner[a] + i], column = unknown[dim * corner[b] + j];
              if (column >= 0 && row >= column) entries[{column, row}] += block(i, j);
            }
        }
    } while (std::next_permutation(order.begin(), order.end()));
  }
  const int n = static_cast<int>(result.dofs.size());
  result.pattern.order = n;
  result.pattern.column_starts.assign(n + 1, 0);
  result.full = Dense::Zero(n, n);
  for (const auto& [place, value] : entries) {
    ++result.pattern.column_starts[place.first + 1];
    result.pattern.row_indices.push_back(place.second);
    result.values.push_back(value);
    result.full(place.first, place.second) = result.full(place.second, place.first) = value;
  }
  for (int j = 0; j < n; ++j) result.pattern.column_starts[j + 1] += result.pattern.column_starts[j];
  return result;
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
    if (!info.available) GTEST_SKIP() << info.name << " is absent: " << info.reason;
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

TEST_P(EverySolver, SolvesMoreThanAThousandUnknownsOrRefusesThem) {
  const Elastic system = elasticity(2, 27, 0.3);
  ASSERT_GT(system.pattern.order, 1024);
  const Outcome analyzed = solver_->analyze(system.pattern, system.hints());
  if (GetParam().info.name == "amesos2:tacho") {
    EXPECT_EQ(analyzed, Outcome::failed);
    EXPECT_NE(solver_->message().find("1024"), std::string::npos);
    EXPECT_EQ(solver_->factorize(system.values), Outcome::failed);  // of a refused analysis
    return;
  }
  ASSERT_EQ(analyzed, Outcome::ok) << solver_->message();
  const std::vector<double> b(system.pattern.order, 1.0);
  std::vector<double> x(b.size());
  for (int i = 0; i < 2; ++i) {
    ASSERT_EQ(solver_->factorize(system.values), Outcome::ok) << solver_->message();
    EXPECT_EQ(solver_->solve(b, x, 1, 1e-9).outcome, Outcome::ok) << solver_->message();
  }
  const Eigen::Map<const Eigen::VectorXd> solution(x.data(), x.size());
  EXPECT_LE((Eigen::VectorXd::Ones(x.size()) - system.full * solution).norm(), 2e-9 * std::sqrt(x.size()));
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
  if (solver_->capabilities().indefinite) return expect_solves(system, 1e-10);
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
  std::string name = ::testing::PrintToString(info.param);
  for (char& c : name)
    if (!std::isalnum(static_cast<unsigned char>(c))) c = '_';
  return name;
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

TEST(Systems, ComeBackFromTheDiskAsTheyWereSolved) {
  const auto folder = std::filesystem::path(::testing::TempDir()) / ("itr_systems_" + std::to_string(::getpid()));
  const Elastic elastic = elasticity(2, 5, 0.3);
  const auto solver = make_dumping_solver(Registry().create("eigen"), folder, 2);
  ASSERT_EQ(solver->analyze(elastic.pattern, elastic.hints()), Outcome::ok);
  ASSERT_EQ(solver->factorize(elastic.values), Outcome::ok);
  std::vector<double> b(elastic.pattern.order), x(b.size());
  for (std::size_t i = 0; i < b.size(); ++i) b[i] = std::cos(static_cast<double>(i));
  for (int i = 0; i < 3; ++i) EXPECT_EQ(solver->solve(b, x, 1, 1e-10).outcome, Outcome::ok);
  EXPECT_FALSE(std::filesystem::exists(folder / "000001"));
  const DumpedSystem back = read_system(folder / "000002");
  EXPECT_EQ(back.pattern, elastic.pattern);
  EXPECT_EQ(back.values, elastic.values);
  EXPECT_EQ(back.rhs, b);
  EXPECT_EQ(back.block_size, 2);
  EXPECT_EQ(back.dofs, elastic.dofs);
  EXPECT_EQ(back.coordinates, elastic.coordinates);
  EXPECT_THROW(read_system(folder / "000001"), InputError);
  std::filesystem::remove_all(folder);
}

TEST(Systems, AreRefusedWhereTheirFilesAreDamaged) {
  const auto folder = std::filesystem::path(::testing::TempDir()) / ("itr_damaged_" + std::to_string(::getpid()));
  const Elastic elastic = elasticity(2, 3, 0.3);
  const DumpedSystem good{elastic.pattern, elastic.values,     std::vector<double>(elastic.pattern.order, 1.0), 2,
                          elastic.dofs,    elastic.coordinates};
  const auto is_refused = [&] {
    EXPECT_THROW(read_system(folder), InputError);
    write_system(folder, good);
  };
  write_system(folder, good);
  EXPECT_NO_THROW(read_system(folder));
  const auto refused = [&](auto&& damage) {
    DumpedSystem system = good;
    damage(system);
    write_system(folder, system);
    is_refused();
  };
  refused([](DumpedSystem& s) { s.pattern.row_indices.back() = 1000; });
  refused([](DumpedSystem& s) { s.pattern.row_indices[1] = -1; });
  refused([](DumpedSystem& s) { std::swap(s.pattern.column_starts[1], s.pattern.column_starts[2]); });
  refused([](DumpedSystem& s) { s.pattern.column_starts[0] = 1; });
  refused([](DumpedSystem& s) { s.rhs.pop_back(); });
  refused([](DumpedSystem& s) { s.coordinates.resize(s.dofs.size()); });
  refused([](DumpedSystem& s) { s.dofs[1] = s.dofs[0]; });
  refused([](DumpedSystem& s) { s.block_size = 0; });
  std::filesystem::resize_file(folder / "values.npy", 200);
  is_refused();
  for (const std::string shape : {"(-1", "(x", "(9999999999999999999999", "(999999999999"}) {
    const auto file = folder / "values.npy";
    std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
    std::string header(128, ' ');
    stream.read(header.data(), 128);
    const auto place = header.find("(");
    header.replace(place, shape.size(), shape);
    stream.seekp(0);
    stream.write(header.data(), 128);
    stream.close();
    is_refused();
  }
  std::filesystem::remove_all(folder);
}

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

TEST(Solver, AnalysesAPatternOnceUnlessItMayUsePositions) {
  const SparsityPattern one = from_dense(tridiagonal(5, 4, 1)).pattern, other = from_dense(tridiagonal(6, 4, 1)).pattern;
  for (const bool iterative : {false, true}) {
    int analyses = 0;
    const auto solver =
        make_checked_solver("counting", {.iterative = iterative}, std::make_unique<CountingEngine>(analyses));
    for (const auto& pattern : {one, one, other, other, one}) EXPECT_EQ(solver->analyze(pattern, {}), Outcome::ok);
    EXPECT_EQ(analyses, iterative ? 5 : 3);
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

TEST(Muelu, NeedsNotMoreIterationsOnFinerMeshesAndFewerWithRigidModes) {
  Registry registry = full_registry();
  if (const auto info = registry.find("belos:muelu"); !info.available) GTEST_SKIP() << info.reason;
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

TEST(Muelu, TellsAnIndefiniteMatrixWhoseDiagonalIsPositive) {
  Registry registry = full_registry();
  if (const auto info = registry.find("belos:muelu"); !info.available) GTEST_SKIP() << info.reason;
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
