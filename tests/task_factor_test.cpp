// SPDX-License-Identifier: MIT
// The factorisation by tasks: the same bits on any number of threads, and CHOLMOD's solutions.
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <array>
#include <cmath>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "itr/core.hpp"
#include "itr/solver.hpp"
#include "linear_systems.hpp"

namespace itr::linear {
namespace {

/// A sum of entries, as assembly makes one.
struct Entries {
  std::map<std::pair<int, int>, double> of;  ///< (column, row) of the lower triangle
  void add(int i, int j, double value) { of[{std::min(i, j), std::max(i, j)}] += value; }
  /// Adds weight * g gᵀ.
  template <std::size_t N>
  void add_square(const std::array<int, N>& unknowns, const std::array<double, N>& g, double weight) {
    for (std::size_t a = 0; a < N; ++a)
      for (std::size_t b = 0; b <= a; ++b) add(unknowns[a], unknowns[b], weight * g[a] * g[b]);
  }
  System system(int order) const {
    System system;
    system.pattern.order = order;
    system.pattern.column_starts.assign(order + 1, 0);
    for (const auto& [place, value] : of) {
      ++system.pattern.column_starts[place.first + 1];
      system.pattern.row_indices.push_back(place.second);
      system.values.push_back(value);
    }
    for (int j = 0; j < order; ++j) system.pattern.column_starts[j + 1] += system.pattern.column_starts[j];
    return system;
  }
};

/// Unknowns coupled at random to others whose numbers are near, and a few far ones.
System random_system(int order, unsigned seed) {
  std::mt19937 random(seed);
  Entries entries;
  for (int i = 0; i < order; ++i) {
    entries.add(i, i, 1);
    for (int k = 0; k < 3; ++k) {
      const int reach = k == 2 && i % 50 == 0 ? order : 40;
      const int j = std::min(order - 1, i + 1 + static_cast<int>(random() % reach));
      if (j != i) entries.add_square<2>({i, j}, {1, -0.1 - 1e-9 * (random() % 100)}, 1 + random() % 7);
    }
  }
  return entries.system(order);
}

/// Two cubes of springs, the lower one soft and held at its bottom, whose faces touch: barriers couple four nodes of each
/// pair, 10⁶ times as stiff.
System contact_system(int side) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  Entries entries;
  const int body = side * side * side;
  const auto couple = [&](int a, int b, double stiff) {
    const double x = normal(random), y = normal(random), z = normal(random);
    entries.add_square<6>({3 * a, 3 * a + 1, 3 * a + 2, 3 * b, 3 * b + 1, 3 * b + 2}, {x, y, z, -x, -y, -z}, stiff);
  };
  for (int node = 0; node < 2 * body; ++node) {
    const int at = node % body, x = at % side, y = at / side % side, z = at / side / side;
    for (int c = 0; c < 3; ++c) entries.add(3 * node + c, 3 * node + c, node < body && z == 0 ? 1e3 : 1e-2);
    for (int repeat = 0; repeat < 3; ++repeat) {
      if (x + 1 < side) couple(node, node + 1, node < body ? 1 : 100);
      if (y + 1 < side) couple(node, node + side, node < body ? 1 : 100);
      if (z + 1 < side) couple(node, node + side * side, node < body ? 1 : 100);
    }
  }
  for (int pair = 0; pair + side + 1 < side * side; pair += 2) {
    const int top = body - side * side + pair, bottom = body + pair;
    std::array<int, 12> unknowns{};
    std::array<double, 12> g{};
    const std::array<int, 4> nodes = {bottom, top, top + 1, top + side};
    for (int a = 0; a < 4; ++a)
      for (int c = 0; c < 3; ++c) {
        unknowns[3 * a + c] = 3 * nodes[a] + c;
        g[3 * a + c] = (a == 0 ? 1.0 : -1.0 / 3) * (c == 2 ? 1 : 0.01);
      }
    entries.add_square<12>(unknowns, g, 1e6);
  }
  return entries.system(6 * body);
}

struct Answer {
  std::vector<double> x;
  std::string message;
  bool operator==(const Answer&) const = default;
};

class TaskFactor : public ::testing::Test {
 protected:
  void SetUp() override {
    const BackendInfo info = registry_.find("cholmod:tasks");
    if (!info.available) GTEST_SKIP() << "a machine without " << info.name << " does without: " << info.reason;
  }
  /// Solutions for two right-hand sides; the message where the matrix is refused.
  Answer answer(const std::string& name, const System& system, const SolverOptions& options = {}) {
    const auto solver = registry_.create(name, options);
    const std::size_t n = system.pattern.order;
    std::vector<double> b(2 * n);
    for (std::size_t i = 0; i < b.size(); ++i) b[i] = std::cos(1.0 + i % (n + 3));
    Answer answer{std::vector<double>(2 * n), {}};
    EXPECT_EQ(solver->analyze(system.pattern, {.block_size = 3}), Outcome::ok) << solver->message();
    for (int repeat = 0; repeat < 2; ++repeat) {  // with memory that is new, and that was used
      const Outcome outcome = solver->factorize(system.values);
      if (outcome != Outcome::ok) return {{}, to_string(outcome) + (": " + solver->message())};
      const SolveReport report = solver->solve(b, answer.x, 2, 1e-9);
      EXPECT_EQ(report.outcome, Outcome::ok) << report.relative_residual;
    }
    return answer;
  }
  Answer answer_on(int threads, const System& system, const SolverOptions& options = {}) {
    const ThreadLimit limit(threads);
    tbb::task_arena arena(threads);
    return arena.execute([&] { return answer("cholmod:tasks", system, options); });
  }
  void expect_same_bits(const System& system, const SolverOptions& options = {}) {
    const Answer one = answer_on(1, system, options);
    for (const int threads : {2, 3, 8})
      for (int repeat = 0; repeat < 3; ++repeat)
        EXPECT_EQ(answer_on(threads, system, options), one) << threads << " threads";
  }
  /// Relative to the largest value.
  void expect_solution_of_cholmod(const System& system, double tolerance) {
    const Answer ours = answer_on(2, system), theirs = answer("cholmod:supernodal", system);
    ASSERT_EQ(ours.x.size(), theirs.x.size());
    double largest = 0, error = 0;
    for (std::size_t i = 0; i < ours.x.size(); ++i) {
      largest = std::max(largest, std::abs(theirs.x[i]));
      error = std::max(error, std::abs(ours.x[i] - theirs.x[i]));
    }
    EXPECT_LE(error, tolerance * largest);
  }
  Registry registry_ = full_registry();
};

TEST_F(TaskFactor, HasTheSameBitsOnAnyNumberOfThreads) {
  for (const char* ordering : {"amd", "metis"}) {
    expect_same_bits(laplacian(28), {{"ordering", ordering}});
    expect_same_bits(contact_system(10), {{"ordering", ordering}});
  }
  for (const int order : {5, 300, 4000, 12000}) expect_same_bits(random_system(order, order));
}

TEST_F(TaskFactor, FindsTheSolutionsOfCholmod) {
  expect_solution_of_cholmod(laplacian(28), 1e-12);
  expect_solution_of_cholmod(contact_system(10), 1e-7);  // whose condition number is 10⁹
  for (const int order : {1, 5, 300, 4000, 12000}) expect_solution_of_cholmod(random_system(order, order), 1e-10);
}

/// Whichever task meets a pivot that is not positive first, the first one in the order of the factor is reported.
TEST_F(TaskFactor, NamesTheSamePivotOnAnyNumberOfThreads) {
  System system = laplacian(28);
  for (int j = 1000; j < system.pattern.order; j += 3000) system.values[system.pattern.column_starts[j]] = -1;
  EXPECT_NE(answer_on(1, system).message.find("not positive definite at pivot"), std::string::npos);
  expect_same_bits(system);
}

/// A front of its own tiles whose last pivot fails: what other tasks have begun ends without harm.
TEST_F(TaskFactor, GoesOnAfterAFailedFactorization) {
  const ThreadLimit limit(3);
  tbb::task_arena arena(3);
  arena.execute([&] {
    const System system = laplacian(24);
    std::vector<double> b(system.pattern.order, 1.0), x(b.size()), first;
    const auto solver = registry_.create("cholmod:tasks");
    ASSERT_EQ(solver->analyze(system.pattern, {}), Outcome::ok);
    for (const double shift : {0.0, -0.5, 0.0, -6.5, 0.0}) {
      auto values = system.values;
      for (int j = 0; j < system.pattern.order; ++j) values[system.pattern.column_starts[j]] += shift;
      const Outcome outcome = solver->factorize(values);
      ASSERT_EQ(outcome, shift == 0 ? Outcome::ok : Outcome::not_positive_definite) << shift;
      if (outcome != Outcome::ok) continue;
      ASSERT_EQ(solver->solve(b, x, 1, 1e-10).outcome, Outcome::ok);
      if (first.empty()) first = x;
      EXPECT_EQ(x, first);
    }
  });
}

}  // namespace
}  // namespace itr::linear
