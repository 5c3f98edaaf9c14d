// SPDX-License-Identifier: MIT
// From what a scene asks for to a solver: names, options, fallbacks, `auto`, and simulations side by side.
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "itr/core.hpp"
#include "itr/scene.hpp"
#include "linear/choice.hpp"
#include "simulation/state.hpp"

namespace itr::linear {
namespace {

const std::vector<std::filesystem::path> kNoModules;  ///< folders to search

/// Does what it is told; solves exactly otherwise: the matrices here are multiples of the identity.
class Scripted final : public Engine {
 public:
  struct Script {
    Outcome analyze = Outcome::ok, factorize = Outcome::ok;
    double error = 0;      ///< of the solution, relative
    int* calls = nullptr;  ///< of factorize
    Outcome solve = Outcome::ok;
  };
  explicit Scripted(Script script) : script_(script) {}
  bool set_option(const std::string&, const std::string&) override { return false; }
  Outcome analyze(const SparsityPattern&, const AnalyzeHints&) override { return script_.analyze; }
  Outcome factorize(std::span<const double> values) override {
    if (script_.calls) ++*script_.calls;
    scale_ = values[0];
    return script_.factorize;
  }
  Outcome solve(std::span<const double> B, std::span<double> X, int) override {
    for (std::size_t i = 0; i < B.size(); ++i) X[i] = B[i] / scale_ * (1 + (i % 2 ? 1 : -1) * script_.error);
    return script_.solve;
  }
  Statistics statistics() const override { return {}; }
  std::string message() const override { return "as told"; }

 private:
  Script script_;
  double scale_ = 1;
};

void add(Registry& registry, const std::string& name, Scripted::Script script) {
  BackendInfo info;
  info.name = name;
  registry.add(info, [=](const SolverOptions& options) {
    auto engine = std::make_unique<Scripted>(script);
    apply_options(*engine, name, "", options);
    return make_checked_solver(name, {}, std::move(engine));
  });
}

struct Log {
  std::vector<std::string> lines;
  Logger logger() {
    return Logger([this](LogLevel, std::string_view message) { lines.emplace_back(message); });
  }
};

SparsityPattern diagonal_pattern(int n) {
  SparsityPattern pattern;
  pattern.order = n;
  for (int i = 0; i < n; ++i) {
    pattern.column_starts.push_back(i);
    pattern.row_indices.push_back(i);
  }
  pattern.column_starts.push_back(n);
  return pattern;
}

/// Analyses, factorises and solves 2 x = 1; the worst outcome of the three.
Outcome solve(Solver& solver, double& residual, std::vector<double> values = std::vector<double>(4, 2.0)) {
  residual = 1;
  if (const Outcome outcome = solver.analyze(diagonal_pattern(4), {}); outcome != Outcome::ok) return outcome;
  if (const Outcome outcome = solver.factorize(values); outcome != Outcome::ok) return outcome;
  const std::vector<double> b(4, 1.0);
  std::vector<double> x(4);
  const SolveReport report = solver.solve(b, x, 1, 1e-8);
  residual = report.relative_residual;
  if (report.outcome != Outcome::ok) return report.outcome;
  for (const double value : x) EXPECT_NEAR(value, 0.5, 1e-8);
  return report.outcome;
}

TEST(Fallback, TakesOverWhateverFails) {
  for (const auto& script :
       {Scripted::Script{.analyze = Outcome::failed}, Scripted::Script{.analyze = Outcome::out_of_memory},
        Scripted::Script{.factorize = Outcome::singular}, Scripted::Script{.factorize = Outcome::not_converged},
        Scripted::Script{.error = 0.9}, Scripted::Script{.solve = Outcome::failed},
        Scripted::Script{.error = std::numeric_limits<double>::quiet_NaN()}}) {
    Registry registry(kNoModules);
    add(registry, "weak", script);
    Log log;
    const auto solver =
        choose_solver({.solvers = {"weak"}, .fallback = {"eigen:ldlt"}, .options = {}}, false, registry, log.logger());
    EXPECT_EQ(solver->name(), "weak");
    double residual = 1;
    EXPECT_EQ(solve(*solver, residual), Outcome::ok);
    EXPECT_LE(residual, 1e-14);
    ASSERT_EQ(log.lines.size(), 1u);
    EXPECT_NE(log.lines[0].find("weak"), std::string::npos) << log.lines[0];
    EXPECT_NE(log.lines[0].find("falling back to eigen:ldlt"), std::string::npos) << log.lines[0];
  }
}

TEST(Fallback, LeavesAlonePositiveDefinitenessAndBadNumbers) {
  Registry registry(kNoModules);
  int calls = 0;
  add(registry, "first", {.factorize = Outcome::not_positive_definite});
  add(registry, "second", {.calls = &calls});
  Log log;
  const auto solver =
      choose_solver({.solvers = {"first"}, .fallback = {"second"}, .options = {}}, false, registry, log.logger());
  double residual = 1;
  EXPECT_EQ(solve(*solver, residual), Outcome::not_positive_definite);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(solve(*solver, residual, {1, nan, 1, 1}), Outcome::non_finite);
  EXPECT_EQ(calls, 0);
}

TEST(Fallback, StartsAtTheTopOfTheListWithEachAnalysis) {
  Registry registry(kNoModules);
  int calls = 0;
  add(registry, "first", {.factorize = Outcome::singular, .calls = &calls});
  const auto solver = choose_solver({.solvers = {"first"}, .fallback = {"eigen:ldlt"}, .options = {}}, false, registry, {});
  double residual = 1;
  EXPECT_EQ(solve(*solver, residual), Outcome::ok);
  EXPECT_EQ(solve(*solver, residual), Outcome::ok);
  EXPECT_EQ(calls, 2);
}

TEST(Fallback, KeepsTheBestOfPoorAnswers) {
  Registry registry(kNoModules);
  add(registry, "poor", {.error = 0.7});
  add(registry, "poorer", {.error = 0.99});
  const auto solver = choose_solver({.solvers = {"poor"}, .fallback = {"poorer"}, .options = {}}, false, registry, {});
  double residual = 1;
  EXPECT_EQ(solve(*solver, residual), Outcome::not_converged);
  EXPECT_LT(residual, 0.7);
  EXPECT_GT(residual, 1e-8);
}

const double kNan = std::numeric_limits<double>::quiet_NaN();

TEST(Fallback, KeepsAPoorAnswerWhereTheOtherHasNone) {
  for (const auto& without : {Scripted::Script{.solve = Outcome::failed}, Scripted::Script{.solve = Outcome::out_of_memory},
                              Scripted::Script{.error = kNan}, Scripted::Script{.factorize = Outcome::out_of_memory},
                              Scripted::Script{.analyze = Outcome::failed}}) {
    for (const bool poor_first : {true, false}) {
      if (!poor_first && (without.analyze != Outcome::ok || without.factorize != Outcome::ok)) continue;
      Registry registry(kNoModules);
      int poors_calls = 0;
      add(registry, "poor", {.error = 1e-6, .calls = &poors_calls});
      add(registry, "without", without);
      const LinearOptions options{.solvers = {poor_first ? "poor" : "without"},
                                  .fallback = {poor_first ? "without" : "poor"}};
      const auto solver = choose_solver(options, false, registry, {});
      std::vector<double> values(4, 2.0), b(4, 1.0), x(4);
      ASSERT_EQ(solver->analyze(diagonal_pattern(4), {}), Outcome::ok);
      ASSERT_EQ(solver->factorize(values), Outcome::ok);
      for (int again = 0; again < 2; ++again) {
        const SolveReport report = solver->solve(b, x, 1, 1e-30);
        EXPECT_EQ(report.outcome, Outcome::not_converged);
        EXPECT_LE(report.relative_residual, 1e-6);
        for (const double value : x) EXPECT_NEAR(value, 0.5, 1e-5);
      }
      const int calls = poors_calls;
      EXPECT_EQ(solver->factorize(values), Outcome::ok);  // by the one whose answer was kept
      EXPECT_EQ(poors_calls, calls + 1);
    }
  }
}

TEST(Fallback, LeavesTheFirstFailureWhereNobodyCopes) {
  Registry registry(kNoModules);
  int calls = 0;
  add(registry, "first", {.factorize = Outcome::singular, .calls = &calls});
  add(registry, "second", {.factorize = Outcome::out_of_memory});
  Log log;
  const auto solver = choose_solver({.solvers = {"first"}, .fallback = {"second"}}, false, registry, log.logger());
  const std::vector<double> values(4, 2.0);
  ASSERT_EQ(solver->analyze(diagonal_pattern(4), {}), Outcome::ok);
  for (int shift = 1; shift <= 2; ++shift) {  // Newton shifts a singular matrix and gives up on memory
    EXPECT_EQ(solver->factorize(values), Outcome::singular);
    EXPECT_EQ(calls, shift);
  }
}

TEST(Fallback, NamesEachSolverWithItsOwnOutcome) {
  Registry registry(kNoModules);
  add(registry, "first", {.error = 0.9});
  add(registry, "second", {.factorize = Outcome::out_of_memory});
  Log log;
  const LinearOptions options{.solvers = {"first"}, .fallback = {"second", "eigen:ldlt"}};
  const auto solver = choose_solver(options, false, registry, log.logger());
  double residual = 1;
  EXPECT_EQ(solve(*solver, residual), Outcome::ok);
  ASSERT_EQ(log.lines.size(), 2u);
  EXPECT_NE(log.lines[0].find("first: not converged"), std::string::npos) << log.lines[0];
  EXPECT_NE(log.lines[1].find("second: out of memory"), std::string::npos) << log.lines[1];
}

TEST(Fallback, PassesOnThatTheMatrixIsNotPositiveDefinite) {
  Registry registry(kNoModules);
  add(registry, "first", {.error = kNan});
  add(registry, "second", {.factorize = Outcome::not_positive_definite});
  const auto solver = choose_solver({.solvers = {"first"}, .fallback = {"second"}}, false, registry, {});
  double residual = 1;
  EXPECT_EQ(solve(*solver, residual), Outcome::not_positive_definite);
}

TEST(Choice, TakesTheFirstThatIsThereAndPassesOverOthersNames) {
  Registry registry(kNoModules);
  const auto name = [&](std::vector<std::string> solvers) { return choose_name({solvers, {}, {}}, registry); };
  EXPECT_EQ(name({"Eigen::PardisoLDLT", "Eigen::SparseLU"}), "eigen:lu");
  EXPECT_EQ(name({"mumps", "eigen:llt"}), "eigen:llt");  // absent: there are no modules
  EXPECT_EQ(name({"Eigen::PardisoLDLT"}), "eigen:ldlt");
  EXPECT_EQ(name({"auto", "eigen:llt"}), "auto");
  EXPECT_THROW(name({"mumps"}), InputError);
  EXPECT_THROW(name({"no-such-solver", "eigen"}), InputError);
}

TEST(Choice, ChecksFallbacksAndOptionsBeforeAnythingRuns) {
  Registry registry(kNoModules);
  const auto refused = [&](const LinearOptions& options) {
    try {
      choose_solver(options, false, registry, {});
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_NE(refused({{"eigen"}, {"no-such-solver"}, {}}).find("no-such-solver"), std::string::npos);
  EXPECT_NE(refused({{"eigen"}, {}, {{"eigen:ldlt", {{"ordering", "metis"}}}}}).find("ordering=metis"), std::string::npos);
  EXPECT_NE(refused({{"eigen"}, {}, {{"no-such-solver", {{"a", "b"}}}}}).find("no-such-solver"), std::string::npos);
  EXPECT_EQ(refused({{"eigen:cg"}, {"mumps"}, {{"eigen:cg", {{"tolerance", "1e-9"}}}}}),
            "");  // an absent fallback only warns
}

/// Under a name that auto takes for large systems: notes its options, or cannot be created.
void add_large(Registry& registry, SolverOptions* seen, const std::string& name = "cholmod") {
  BackendInfo info;
  info.name = name;
  registry.add(info, [=](const SolverOptions& options) -> std::unique_ptr<Solver> {
    if (!seen) throw InputError({"", "linear solver", "no licence", "a licence"});
    *seen = options;
    return make_checked_solver(name, {}, std::make_unique<Scripted>(Scripted::Script{}));
  });
}

TEST(Auto, HandsOptionsToWhatItPicks) {
  const SolverOptions metis = {{"ordering", "metis"}};
  for (const bool as_fallback : {false, true}) {
    Registry registry(kNoModules);
    add(registry, "weak", {.analyze = Outcome::failed});
    SolverOptions seen;
    add_large(registry, &seen, as_fallback ? "cholmod" : "cholmod:tasks");  // which has the options of cholmod
    LinearOptions options;
    options.solvers = {as_fallback ? "weak" : "auto"};
    if (as_fallback) options.fallback = {"auto"};
    options.options = {{"cholmod", metis}};
    const auto solver = choose_solver(options, false, registry, {});
    seen.clear();
    EXPECT_EQ(solver->analyze(diagonal_pattern(100'000), {}), Outcome::ok);
    EXPECT_EQ(seen, metis);
  }
}

TEST(Auto, FailsWithTheReasonWhereItsPickCannotBeCreated) {
  Registry registry(kNoModules);
  add_large(registry, nullptr);
  const auto solver = choose_solver({.solvers = {"auto"}}, false, registry, {});
  EXPECT_EQ(solver->analyze(diagonal_pattern(100'000), {}), Outcome::failed);
  EXPECT_NE(solver->message().find("no licence"), std::string::npos) << solver->message();
  double residual = 1;
  EXPECT_EQ(solve(*solver, residual), Outcome::ok);  // a small one: another pick
}

TEST(Choice, CreatesNoSolverThatWillNotRun) {
  Registry registry(kNoModules);
  add_large(registry, nullptr);
  LinearOptions options{.solvers = {"eigen"}, .options = {{"cholmod", {{"ordering", "metis"}}}}};
  EXPECT_NO_THROW(choose_solver(options, false, registry, {}));
  options.fallback = {"cholmod"};
  EXPECT_THROW(choose_solver(options, false, registry, {}), InputError);
}

auto there(std::set<std::string> names) {
  return [names = std::move(names)](const char* name) { return names.contains(name); };
}

TEST(Auto, PicksBySizeDefinitenessAndWhatIsThere) {
  const auto all =
      there({"eigen:ldlt", "dense", "eigen:cg", "cholmod", "cholmod:tasks", "mumps", "mumps:spd", "umfpack", "belos:muelu"});
  const auto none = there({"eigen:ldlt", "dense", "eigen:cg"});
  constexpr double kGiB = 1024.0 * 1024 * 1024;
  const MatrixTraits tiny{30, 200, 2, false, kGiB}, small{1200, 9'000, 2, false, kGiB},
      large{200'000, 1'600'000, 2, false, 64 * kGiB}, large_3d{30'000, 700'000, 3, false, 64 * kGiB},
      indefinite{200'000, 1'600'000, 2, true, 64 * kGiB}, huge{3'000'000, 70'000'000, 3, false, 16 * kGiB};
  EXPECT_EQ(pick_solver(tiny, all).name, "dense");
  EXPECT_EQ(pick_solver(small, all).name, "eigen:ldlt");
  EXPECT_EQ(pick_solver({2000, 16'000, 2, false, kGiB}, all).name, "cholmod:tasks");
  EXPECT_EQ(pick_solver({2000, 16'000, 2, false, kGiB}, none).name, "eigen:ldlt");
  EXPECT_EQ(pick_solver(large, all).name, "cholmod:tasks");
  EXPECT_EQ(pick_solver(large_3d, all).name, "cholmod:tasks");
  EXPECT_EQ(pick_solver({30'000, 700'000, 3, false, 3e9, 2e9}, all).name, "cholmod");  // contributions would not fit
  EXPECT_EQ(pick_solver(large_3d, there({"cholmod", "eigen:ldlt"})).name, "cholmod");
  EXPECT_EQ(pick_solver(large_3d, there({"eigen:ldlt", "mumps:spd"})).name, "mumps:spd");
  EXPECT_EQ(pick_solver(large, none).name, "eigen:ldlt");
  EXPECT_EQ(pick_solver(indefinite, all).name, "mumps");
  EXPECT_EQ(pick_solver(indefinite, there({"eigen:ldlt", "cholmod", "umfpack"})).name, "umfpack");
  EXPECT_EQ(pick_solver(indefinite, none).name, "eigen:ldlt");
  EXPECT_EQ(pick_solver(huge, all).name, "belos:muelu");
  EXPECT_EQ(pick_solver(huge, none).name, "eigen:cg");
  for (const auto& traits : {tiny, small, large, large_3d, indefinite, huge})
    EXPECT_FALSE(pick_solver(traits, all).reason.empty());
}

/// A long thin body: many unknowns whose factors are far smaller than those of a cube.
TEST(Auto, AsksAnAnalysisWhereACubeWouldNotFit) {
  Registry registry;
  if (!registry.is_ready("cholmod:tasks")) GTEST_SKIP() << "cholmod:tasks: " << registry.find("cholmod:tasks").reason;
  SparsityPattern chain;
  chain.order = 1 << 16;
  while (estimate_factor_bytes({chain.order, 0, 3, false, 0}) <
         static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGESIZE)))
    chain.order += chain.order / 4;
  chain.column_starts.push_back(0);
  for (int j = 0; j < chain.order; ++j) {
    for (const int i : {j, j + 1})
      if (i < chain.order) chain.row_indices.push_back(i);
    chain.column_starts.push_back(static_cast<int>(chain.row_indices.size()));
  }
  ASSERT_NE(pick_solver({chain.order, chain.nonzeros(), 3, false, 0}, registry).name, "cholmod:tasks");
  const auto solver = make_auto_solver(registry, false, {});
  EXPECT_EQ(solver->analyze(chain, {.block_size = 3}), Outcome::ok);
  EXPECT_EQ(solver->name_in_use(), "cholmod:tasks");
  EXPECT_EQ(pick_solver({chain.order, chain.nonzeros(), 3, false, 1e9, 2e9}, there({"cholmod", "belos:muelu"})).name,
            "belos:muelu");
}

TEST(Auto, AsksOnlyAboutSolversInQuestion) {  // an answer may load a module of 40 MB and start MPI
  std::vector<std::string> asked;
  const auto all = [&](const char* name) {
    asked.emplace_back(name);
    return true;
  };
  constexpr double kMemory = 64e9;
  pick_solver({1200, 9'000, 2, false, kMemory}, all);
  EXPECT_TRUE(asked.empty());
  pick_solver({30'000, 700'000, 3, false, kMemory}, all);
  EXPECT_EQ(asked, std::vector<std::string>{"cholmod:tasks"});
}

// Fill of the squares and cubes of verification/scaling/results.csv, METIS.
TEST(Auto, ForeseesTheFillOfSquaresAndCubes) {
  const auto expect = [](int order, std::size_t nonzeros, int dim, double fill) {
    const double estimate = estimate_factor_bytes({order, nonzeros, dim, false, 0}) / 8;
    EXPECT_GE(estimate, 0.95 * fill);
    EXPECT_LE(estimate, 2 * fill);
  };
  expect(51'842, 386'243, 2, 3.472e6);
  expect(206'082, 1'540'483, 2, 16.69e6);
  expect(52'728, 1'143'000, 3, 33.2e6);
  expect(255'552, 5'670'975, 3, 305e6);
}

TEST(Auto, LogsWhatItTookAndSolves) {
  Registry registry;
  Log log;
  const auto solver = choose_solver({{"auto"}, {}, {}}, false, registry, log.logger());
  double residual = 1;
  EXPECT_EQ(solve(*solver, residual), Outcome::ok);
  EXPECT_EQ(solve(*solver, residual), Outcome::ok);  // the same pick: no second line
  ASSERT_EQ(log.lines.size(), 1u);
  EXPECT_NE(log.lines[0].find("auto takes dense for 4 unknowns"), std::string::npos) << log.lines[0];
}

struct Masticated {
  VectorX x;
  double energy = 0;
};

/// Some steps of the masticator, which by then is in contact and has been remeshed.
Masticated masticate(Registry& registry, const std::string& solver) {
  auto scene = scene::read(std::filesystem::path(ITR_SOURCE_DIR) / "examples" / "masticator.json");
  auto setup = std::get<Setup<2>>(scene.setup);
  setup.linear.solvers = {solver};
  Simulation<2> simulation(std::move(setup), registry);
  Masticated end;
  for (int i = 0; i < 25; ++i) {
    const auto result = simulation.advance();
    EXPECT_TRUE(result.ok) << solver << ": " << result.reason;
    end.energy = result.report.energy.total;
  }
  end.x = simulation.state().history.x[0];
  return end;
}

TEST(Simulations, OfDifferentSolversInThreadsDoNotDisturbEachOther) {
  Registry registry;
  registry.allow_mpi_start();
  std::vector<std::string> names;
  for (const char* name : {"eigen:ldlt", "cholmod", "mumps", "amesos2:klu2", "umfpack", "belos:muelu"})
    if (registry.find(name).available) names.push_back(name);
  std::vector<Masticated> alone, together(names.size());
  for (const auto& name : names) alone.push_back(masticate(registry, name));
  ASSERT_GT(alone[0].energy, 1);
  for (const auto& other : alone)  // all solve the same problem; round-off decides which of equal edges is split first
    EXPECT_NEAR(other.energy, alone[0].energy, 1e-3 * alone[0].energy);
  std::vector<std::thread> threads;
  for (std::size_t i = 0; i < names.size(); ++i)
    threads.emplace_back([&, i] {
      Registry own;
      own.allow_mpi_start();
      together[i] = masticate(own, names[i]);
    });
  for (auto& thread : threads) thread.join();
  for (std::size_t i = 0; i < names.size(); ++i) EXPECT_EQ(together[i].x, alone[i].x) << names[i];  // bit for bit
}

}  // namespace
}  // namespace itr::linear
