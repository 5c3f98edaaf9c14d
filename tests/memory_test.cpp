// SPDX-License-Identifier: MIT
// Every solver says so when memory is out, wherever in its work that is, and can be used again.
#include <gtest/gtest.h>
#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <fstream>
#include <string>

#include "linear_systems.hpp"

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // which reserve address space without bound
namespace itr::linear {

inline void PrintTo(const BackendInfo& info, std::ostream* out) { *out << info.name; }

namespace {

/// So many bytes of address space more than the process has; all there is when it goes out of scope.
class SpareMemory {
 public:
  explicit SpareMemory(rlim_t bytes) {
    malloc_trim(0);
    std::ifstream file("/proc/self/statm");
    rlim_t pages = 0;
    file >> pages;
    getrlimit(RLIMIT_AS, &before_);
    const rlimit limit{pages * static_cast<rlim_t>(sysconf(_SC_PAGESIZE)) + bytes, before_.rlim_max};
    setrlimit(RLIMIT_AS, &limit);
  }
  ~SpareMemory() { setrlimit(RLIMIT_AS, &before_); }
  SpareMemory(const SpareMemory&) = delete;
  SpareMemory& operator=(const SpareMemory&) = delete;

 private:
  rlimit before_{};
};

/// The stack of the main thread is address space too, and grows where a function wants more: no library can help that.
void grow_stack() {
  volatile char stack[1 << 20];
  for (std::size_t i = 0; i < sizeof stack; i += 1024) stack[i] = 0;
}

class EverySolver : public ::testing::TestWithParam<BackendInfo> {};

TEST_P(EverySolver, SaysThatMemoryIsOut) {
  if (!GetParam().available)
    GTEST_SKIP() << "a machine without " << GetParam().name << " does without: " << GetParam().reason;
  Registry registry = full_registry();
  const bool dense = GetParam().name == "dense";
  const System small = laplacian(8), large = laplacian(dense ? 13 : 24);
  std::vector<double> ones(large.pattern.order, 1.0), solution(ones.size());
  const auto solve = [&](Solver& solver, const System& system) {
    const std::size_t n = system.pattern.order;
    Outcome outcome = solver.analyze(system.pattern, {});
    if (outcome == Outcome::ok) outcome = solver.factorize(system.values);
    if (outcome == Outcome::ok) outcome = solver.solve({ones.data(), n}, {solution.data(), n}, 1, 1e-8).outcome;
    return outcome;
  };
  const auto solver = registry.create(GetParam().name);
  ASSERT_EQ(solve(*solver, small), Outcome::ok) << solver->message();  // libraries take what they keep
  grow_stack();
  int failures = 0;
  for (rlim_t bytes = 1 << 18; bytes <= rlim_t{1} << 28; bytes += bytes / 2) {
    Outcome outcome{};
    bool claims_without_factors = false;
    std::string message;
    {
      const SpareMemory limit(bytes);
      outcome = solve(*solver, large);
      message = solver->message();
      for (int i = 0; i < 2 && outcome != Outcome::ok; ++i) {  // whoever goes on all the same
        const bool has_factors = solver->factorize(large.values) == Outcome::ok;
        const bool has_solution = solver->solve(ones, solution, 1, 1e-8).outcome == Outcome::ok;
        claims_without_factors = claims_without_factors || (has_solution && !has_factors);
      }
    }
    SCOPED_TRACE(std::to_string(bytes) + " bytes: " + to_string(outcome) + ", " + message);
    EXPECT_TRUE(outcome == Outcome::ok || outcome == Outcome::out_of_memory);
    EXPECT_FALSE(claims_without_factors);
    failures += outcome == Outcome::out_of_memory;
  }
  EXPECT_GT(failures, 0);  // else nothing was tested
  EXPECT_EQ(solve(*solver, large), Outcome::ok) << solver->message();
  EXPECT_EQ(solve(*solver, small), Outcome::ok) << solver->message();
}

INSTANTIATE_TEST_SUITE_P(Table, EverySolver, ::testing::ValuesIn(full_registry().list()),
                         [](const auto& info) { return as_test_name(info.param.name); });

}  // namespace
}  // namespace itr::linear
#endif
