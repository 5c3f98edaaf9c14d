// SPDX-License-Identifier: MIT
// Libraries behind the solvers act by themselves: threads that nobody asked for, kernels for another CPU.
#include <gtest/gtest.h>

#include <unistd.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>

#include "itr/core.hpp"
#include "linear/blas_kernels.hpp"
#include "linear_systems.hpp"

namespace itr::linear {
namespace {

constexpr const char* kVariable = "OPENBLAS_CORETYPE";

std::ptrdiff_t count_threads() {
  return std::distance(std::filesystem::directory_iterator("/proc/self/task"), std::filesystem::directory_iterator());
}

/// Debian's CHOLMOD started four threads for each factorisation, which were then there to stay. Solvers by tasks share the
/// threads of loops, of which the limit leaves none.
TEST(Threads, NoSolverStartsItsOwn) {
  const ThreadLimit alone(1);
  Registry registry = full_registry();
  const System cube = laplacian(16);
  std::vector<double> x(cube.pattern.order), b(x.size(), 1);
  for (const auto& info : registry.list()) {
    if (!info.available || info.name == "dense") continue;
    const auto solver = registry.create(info.name);
    self_test_residual(*solver);  // starts MPI and what it keeps running
    const auto before = count_threads();
    ASSERT_EQ(solver->analyze(cube.pattern, {}), Outcome::ok) << info.name;
    ASSERT_EQ(solver->factorize(cube.values), Outcome::ok) << info.name;
    EXPECT_EQ(solver->solve(b, x, 1, 1e-8).outcome, Outcome::ok) << info.name;
    EXPECT_EQ(count_threads(), before) << info.name;
  }
}

/// Four threads of OpenBLAS waited in busy loops: a run of 0.06 s took 0.09 processor seconds.
TEST(Threads, LoadingASolverStartsNone) {
  const auto asked = [] {
    return std::string(std::getenv("OPENBLAS_NUM_THREADS") ? std::getenv("OPENBLAS_NUM_THREADS") : "");
  };
  const std::string asked_before = asked();
  const auto before = count_threads();
  const BackendInfo info = Registry().find("cholmod");
  if (!info.available) GTEST_SKIP() << "a machine without CHOLMOD does without: " << info.reason;
  EXPECT_EQ(count_threads(), before);
  EXPECT_EQ(asked(), asked_before) << "the environment was not put back";
}

std::string solvers_as_listed(const std::string& environment) {
  const std::string command = environment + " " + ITR_BINARY_DIR + "/bin/itr solvers";
  const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
  std::string text;
  std::array<char, 512> part{};
  while (pipe && std::fgets(part.data(), part.size(), pipe.get())) text += part.data();
  return text;
}

/// On machines with AVX2 and OpenBLAS; others have nothing to choose.
class KernelsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!fitting_blas_kernels()) GTEST_SKIP() << "a machine without AVX2 does without: old kernels are the fitting ones";
    if (std::getenv(kVariable)) GTEST_SKIP() << "where " << kVariable << " is set the kernels are the user's choice";
    const BackendInfo info = Registry().find("cholmod");
    if (!info.available) GTEST_SKIP() << "a machine without CHOLMOD does without: " << info.reason;
    if (info.library_version.find("OpenBLAS") == std::string::npos)
      GTEST_SKIP() << "a machine without OpenBLAS does without: CHOLMOD has " << info.library_version;
  }
};

TEST_F(KernelsTest, FitTheCpuWhateverItsModel) {
  const BackendInfo info = Registry().find("cholmod");
  EXPECT_NE(info.library_version.find(std::string("for ") + fitting_blas_kernels()), std::string::npos)
      << info.library_version;
  EXPECT_EQ(info.advice, "");
  EXPECT_EQ(std::getenv(kVariable), nullptr) << "the environment was not put back";
}

TEST_F(KernelsTest, AreTheUsersWhereHeSaysWhich) {
  const std::string text = solvers_as_listed(std::string(kVariable) + "=Prescott");
  EXPECT_NE(text.find("for Prescott"), std::string::npos) << text;
  EXPECT_NE(text.find(std::string("unset ") + kVariable), std::string::npos) << text;
  EXPECT_EQ(solvers_as_listed("").find("Prescott"), std::string::npos);
}

TEST(Kernels, OfOldCpusComeWithAdvice) {
  EXPECT_EQ(advice_on_blas_kernels(""), "");
  EXPECT_EQ(advice_on_blas_kernels("SkylakeX"), "");
  EXPECT_EQ(advice_on_blas_kernels("Haswell"), "");
  EXPECT_EQ(advice_on_blas_kernels("Prescott").empty(), fitting_blas_kernels() == nullptr);
}

/// Dense blocks pay from some flops an entry of the factor: not in a small 2D system.
TEST(Cholmod, ChoosesByFlops) {
  Registry registry = full_registry();
  if (!registry.is_ready("cholmod"))
    GTEST_SKIP() << "a machine without CHOLMOD does without: " << registry.find("cholmod").reason;
  const auto bytes = [&](const char* name, const Elastic& system) {
    const auto solver = registry.create(name);
    EXPECT_EQ(solver->analyze(system.pattern, system.hints()), Outcome::ok);
    EXPECT_EQ(solver->factorize(system.values), Outcome::ok);
    return solver->statistics().factor_bytes;
  };
  const Elastic sheet = elasticity(2, 8, 0.3), cube = elasticity(3, 9, 0.3);
  EXPECT_EQ(bytes("cholmod", sheet), bytes("cholmod:simplicial", sheet));
  EXPECT_NE(bytes("cholmod", sheet), bytes("cholmod:supernodal", sheet));
  EXPECT_EQ(bytes("cholmod", cube), bytes("cholmod:supernodal", cube));
  EXPECT_NE(bytes("cholmod", cube), bytes("cholmod:simplicial", cube));
}

}  // namespace
}  // namespace itr::linear
