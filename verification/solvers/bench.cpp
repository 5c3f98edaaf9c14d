// SPDX-License-Identifier: MIT
// What one solver costs on one dumped system (itr run --dump-systems):
//   [mpirun -n N] itr_solver_bench SYSTEM SOLVER [--analyze | --once] [KEY=VALUE]...
// Prints one line of JSON: seconds of the analysis, of factorisations and solves (the best of three), of both through the
// engine alone where it is a module (without checks, residuals and refinement), fill, bytes, achieved residual. --once: one
// factorisation and no bare engine. --analyze: the analysis alone, and the fill, bytes and flops that it foresees.
#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "cli/ranks.hpp"
#include "itr/core/error.hpp"
#include "itr/core/timer.hpp"
#include "itr/linear/dump.hpp"
#include "itr/linear/registry.hpp"

namespace {

using namespace itr;
using namespace itr::linear;

constexpr double kAskedResidual = 1e-8;  // Newton's (newton/systems.cpp)

template <typename F>
double seconds(F&& f) {
  const double start = seconds_now();
  f();
  return seconds_now() - start;
}

struct Times {
  double analyze = 0, factorize = 0, solve = 0;  ///< [s]
};

/// How often to factorise and solve; 0: analyse only.
enum Repeats { kAnalyze = 0, kOnce = 1, kBestOfThree = 3 };

template <typename Analyze, typename Factorize, typename Solve>
Times measure(Repeats repeats, Analyze&& analyze, Factorize&& factorize, Solve&& solve) {
  Times times;
  times.analyze = seconds(analyze);
  for (int i = 0; i < repeats; ++i) {
    const double factorized = seconds(factorize), solved = seconds(solve);
    times.factorize = i == 0 ? factorized : std::min(times.factorize, factorized);
    times.solve = i == 0 ? solved : std::min(times.solve, solved);
  }
  return times;
}

void bench(Registry& registry, const DumpedSystem& system, const std::string& name, const SolverOptions& options,
           Repeats repeats) {
  std::vector<double> x(system.rhs.size());
  const auto solver = registry.create(name, options);
  Outcome outcome = Outcome::ok;
  double residual = 1;
  const auto keep_worst = [&](Outcome next) { outcome = outcome == Outcome::ok ? next : outcome; };
  const Times checked = measure(
      repeats, [&] { keep_worst(solver->analyze(system.pattern, system.hints())); },
      [&] { keep_worst(solver->factorize(system.values)); },
      [&] {
        const SolveReport report = solver->solve(system.rhs, x, 1, kAskedResidual);
        keep_worst(report.outcome);
        residual = report.relative_residual;
      });
  const Statistics statistics = solver->statistics();
  Times bare{};
  if (const auto engine =
          outcome == Outcome::ok && repeats == kBestOfThree ? registry.create_engine(name, options) : nullptr) {
    bare = measure(
        repeats, [&] { engine->analyze(system.pattern, system.hints()); }, [&] { engine->factorize(system.values); },
        [&] { engine->solve(system.rhs, x, 1); });
  }
  fmt::print(
      "{{\"solver\": \"{}\", \"unknowns\": {}, \"nonzeros\": {}, \"outcome\": \"{}\", \"analyze_s\": {:.4g}, "
      "\"factorize_s\": {:.4g}, \"solve_s\": {:.4g}, \"bare_factorize_s\": {:.4g}, \"bare_solve_s\": {:.4g}, "
      "\"factor_nonzeros\": {:.6g}, \"factor_mb\": {:.4g}, \"largest_rank_mb\": {:.4g}, \"flops\": {:.4g}, "
      "\"iterations\": {}, \"residual\": {}}}\n",
      name, system.pattern.order, system.pattern.nonzeros(), to_string(outcome), checked.analyze, checked.factorize,
      checked.solve, bare.factorize, bare.solve, statistics.factor_nonzeros, statistics.factor_bytes / 1e6,
      statistics.largest_bytes / 1e6, statistics.flops, statistics.iterations,
      std::isfinite(residual) ? fmt::format("{:.2e}", residual) : "null");
  if (outcome != Outcome::ok) fmt::print(stderr, "{}: {}\n", name, solver->message());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    fmt::print(stderr, "usage: itr_solver_bench SYSTEM SOLVER [--analyze | --once] [KEY=VALUE]...\n");
    return 2;
  }
  try {
    SolverOptions options;
    Repeats repeats = kBestOfThree;
    for (int i = 3; i < argc; ++i) {
      const std::string text = argv[i];
      if (text == "--analyze" || text == "--once") {
        repeats = text == "--once" ? kOnce : kAnalyze;
        continue;
      }
      const auto equals = text.find('=');
      if (equals == std::string::npos) throw InputError({"", "option", text, "KEY=VALUE"});
      options[text.substr(0, equals)] = text.substr(equals + 1);
    }
    Registry registry;
    registry.allow_mpi_start();
    const std::string solver = Registry::canonical_name(argv[2]);
    if (cli::this_launch().rank > 0) return cli::serve(registry, solver);
    const cli::RankSession session(registry, solver);
    bench(registry, read_system(argv[1]), solver, options, repeats);
    return 0;
  } catch (const InputError& error) {
    fmt::print(stderr, "itr_solver_bench: {}\n", error.what());
    return 2;
  }
}
