// SPDX-License-Identifier: MIT
// The table of solvers: names, options, modules that do not load, MPI on the program's word only.
#include <gtest/gtest.h>

#include <dlfcn.h>
#include <fmt/format.h>
#include <link.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "itr/core.hpp"
#include "itr/solver.hpp"

namespace itr::linear {
namespace {

/// MUMPS is the solver that runs on MPI.
class MumpsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (const auto info = Registry().find("mumps"); !info.available)
      GTEST_SKIP() << "a machine without MPI does without: " << info.reason;
  }
};

/// First in the file: MPI cannot be stopped again, so where all tests run in one process no other may have started it.
TEST_F(MumpsTest, NeverStartsMpiWithoutTheProgramsWord) {
  Registry registry;
  const std::string name = "mumps";
  EXPECT_FALSE(registry.is_ready(name));
  EXPECT_THROW(registry.create(name), InputError);
  EXPECT_FALSE(registry.is_ready(name));
  registry.allow_mpi_start();
  EXPECT_TRUE(registry.is_ready(name));
  EXPECT_GE(self_test_residual(*registry.create(name)), 0);
}

TEST_F(MumpsTest, OnItsOwnRankOutlivesAConnection) {
  Registry registry;
  registry.allow_mpi_start();
  const auto solver = registry.create("mumps");
  const SparsityPattern pattern{2, {0, 2, 3}, {0, 1, 1}};
  const std::vector<double> values = {2, 1, 2}, b = {3, 3};
  std::vector<double> x(2);
  const auto expect_solves = [&](const char* when) {
    ASSERT_EQ(solver->factorize(values), Outcome::ok) << when << ": " << solver->message();
    ASSERT_EQ(solver->solve(b, x, 1, 1e-12).outcome, Outcome::ok) << when << ": " << solver->message();
    EXPECT_NEAR(x[0], 1, 1e-12);
  };
  ASSERT_EQ(solver->analyze(pattern, {}), Outcome::ok);
  expect_solves("before");
  registry.connect("mumps");
  expect_solves("connected");
  registry.disconnect("mumps");
  expect_solves("after");
}

TEST(Registry, NamesOfOthersMapToOurs) {
  EXPECT_EQ(Registry::canonical_name(""), "eigen:ldlt");
  EXPECT_EQ(Registry::canonical_name("eigen"), "eigen:ldlt");
  EXPECT_EQ(Registry::canonical_name("cholmod"), "cholmod");
  EXPECT_EQ(Registry::canonical_name("Eigen::SimplicialLDLT"), "eigen:ldlt");
  EXPECT_EQ(Registry::canonical_name("Eigen::SparseLU"), "eigen:lu");
  EXPECT_EQ(Registry::canonical_name("Eigen::CholmodSupernodalLLT"), "cholmod:tasks");
  for (const char* name : {"Eigen::PardisoLLT", "Eigen::AccelerateLDLT", "Hypre", "AMGCL", "Trilinos"})
    EXPECT_EQ(Registry::canonical_name(name), "") << name;
}

TEST(Registry, RefusesOptionsThatASolverDoesNotHave) {
  Registry registry;
  registry.allow_mpi_start();
  for (const auto& info : registry.list()) {
    if (!info.available) continue;
    try {
      registry.create(info.name, {{"no-such-option", "1"}});
      ADD_FAILURE() << info.name;
    } catch (const InputError& error) {
      EXPECT_NE(error.parts().place.find(info.name), std::string::npos);
      EXPECT_NE(error.parts().found.find("no-such-option=1"), std::string::npos);
    }
  }
  EXPECT_THROW(registry.create("eigen:cg", {{"tolerance", "2"}}), InputError);
  EXPECT_THROW(registry.create("eigen:cg", {{"tolerance", "1e-9x"}}), InputError);
  EXPECT_NO_THROW(registry.create("eigen:cg", {{"tolerance", "1e-9"}, {"max_iterations", "77"}}));
}

TEST(Registry, RefusesRanksForASolverWithoutMpi) {
  Registry registry;
  EXPECT_THROW(registry.connect("eigen"), InputError);
  EXPECT_THROW(registry.serve("dense"), InputError);
}

TEST(Registry, UnknownNamesListWhatThereIs) {
  try {
    Registry().create("no-such-solver");
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_NE(error.parts().expected.find("eigen:ldlt"), std::string::npos);
    EXPECT_NE(error.parts().expected.find("mumps"), std::string::npos);
  }
}

/// A folder of modules that only this process uses.
class ModuleFolder {
 public:
  ModuleFolder() {
    static int count = 0;  // a new name each time: modules that were loaded stay loaded, by their path
    path_ = std::filesystem::temp_directory_path() / fmt::format("itr_modules_{}_{}", ::getpid(), count++);
    std::filesystem::create_directory(path_);
    setenv("ITR_BACKEND_PATH", path_.c_str(), 1);
  }
  ~ModuleFolder() {
    unsetenv("ITR_BACKEND_PATH");
    std::error_code error;
    std::filesystem::remove_all(path_, error);
  }
  ModuleFolder(const ModuleFolder&) = delete;
  ModuleFolder& operator=(const ModuleFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

std::string reason_of(const std::string& name) {
  for (const auto& info : Registry().list())
    if (info.name == name && !info.available) return info.reason;
  return "no such row, or it is there";
}

TEST(Registry, AModuleThatDoesNotLoadSaysWhyAndTheRestGoOn) {
  const ModuleFolder folder;
  std::ofstream(folder.path() / "itr_backend_broken.so") << "not a library";
  EXPECT_NE(reason_of("itr_backend_broken").find("does not load"), std::string::npos);
  EXPECT_GE(self_test_residual(*Registry().create("eigen")), 0);
}

TEST(Registry, ASolverWhoseModuleDoesNotLoadIsNotCalledMissing) {
  const ModuleFolder folder;
  std::ofstream(folder.path() / "itr_backend_umfpack.so") << "not a library";
  Registry registry({folder.path()});  // not where a good one may be
  EXPECT_NE(registry.find("umfpack").reason.find("does not load"), std::string::npos);
  EXPECT_NE(registry.find("mumps").reason.find("libmumps-dev"), std::string::npos);
}

/// Trilinos and MUMPS would more than double the memory of a small scene.
TEST(Registry, LoadsNoModuleThatBringsOtherSolvers) {
  const std::filesystem::path built = std::filesystem::path(ITR_BINARY_DIR) / "lib" / "itr" / "backends";
  const ModuleFolder folder;
  for (const char* name : {"itr_backend_cholmod.so", "itr_backend_umfpack.so"}) {
    if (!std::filesystem::exists(built / name)) GTEST_SKIP() << "a machine without SuiteSparse does without: no " << name;
    std::filesystem::copy(built / name, folder.path() / name);  // the loader tells files apart, not names
  }
  const auto is_loaded = [&](const char* name) {
    void* handle = dlopen((folder.path() / name).c_str(), RTLD_NOW | RTLD_NOLOAD);
    if (handle) dlclose(handle);
    return handle != nullptr;
  };
  Registry registry({folder.path()});
  EXPECT_TRUE(registry.find("cholmod").available);
  EXPECT_TRUE(is_loaded("itr_backend_cholmod.so"));
  EXPECT_FALSE(is_loaded("itr_backend_umfpack.so"));
  EXPECT_TRUE(registry.find("umfpack").available);
}

TEST(Registry, ALibraryThatIsNoModuleSaysSo) {
  void* handle = dlopen("libm.so.6", RTLD_NOW);
  ASSERT_TRUE(handle);
  link_map* map = nullptr;
  ASSERT_EQ(dlinfo(handle, RTLD_DI_LINKMAP, &map), 0);
  const ModuleFolder folder;
  std::filesystem::create_symlink(map->l_name, folder.path() / "itr_backend_other.so");
  EXPECT_NE(reason_of("itr_backend_other").find("is no solver module"), std::string::npos);
  dlclose(handle);
}

TEST(Registry, AModuleOfAnotherAbiVersionSaysSo) {
  Registry registry({std::filesystem::path(ITR_BINARY_DIR) / "tests" / "modules"});
  const BackendInfo info = registry.find("old_abi_module");
  EXPECT_FALSE(info.available);
  EXPECT_NE(info.reason.find("ABI version 1"), std::string::npos) << info.reason;
  EXPECT_THROW(registry.create("old_abi_module"), InputError);
}

TEST(Registry, AProgramAddsItsOwn) {
  Registry registry;
  BackendInfo info;
  info.name = "mine";
  registry.add(info, [](const SolverOptions&) { return Registry().create("eigen"); });
  EXPECT_GE(self_test_residual(*registry.create("mine")), 0);
  EXPECT_TRUE(registry.find("mine").available);
}

}  // namespace
}  // namespace itr::linear
