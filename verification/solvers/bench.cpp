// SPDX-License-Identifier: MIT
// Costs of one solver on one dumped system (itr_dump_systems):
//   [mpirun -n N] itr_solver_bench SYSTEM SOLVER [--analyze | --once] [--after OTHER] [--threads N] [KEY=VALUE]...
// Prints one line of JSON: seconds of the analysis, of a factorisation and a solve (medians), of both through the engine
// alone where it is a module, what checks, residuals and refinement add to that (the median of the ratios of runs that
// follow each other, less one), fill, bytes, achieved residual. --once: one factorisation and no bare engine. --analyze: the
// analysis alone, and the fill, bytes and flops that it predicts. --after: the analysis may keep the order of that of
// another system, which comes first. --threads: those that a solver by tasks takes. factorise_work_s, factorise_span_s and
// those of the solve are what one core and any number of cores would take, by the times of tasks.
#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "apps/itr/ranks.hpp"
#include "core/profile.hpp"
#include "core/timer.hpp"
#include "dump.hpp"
#include "itr/core.hpp"
#include "itr/solver.hpp"

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
  double factorize = 0, solve = 0;  ///< [s]
  double sum() const { return factorize + solve; }
};

/// How often to factorise and solve.
enum class Repeats {
  none,  ///< analyse only
  once,
  some  ///< for half a second, and at least three times
};

template <typename Factorize, typename Solve>
Times measure(Factorize&& factorize, Solve&& solve) {
  Times times;
  times.factorize = seconds(factorize);
  times.solve = seconds(solve);
  return times;
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
  return values[values.size() / 2];
}

Times median(const std::vector<Times>& times) {
  std::vector<double> factorize, solve;
  for (const Times& t : times) {
    factorize.push_back(t.factorize);
    solve.push_back(t.solve);
  }
  return times.empty() ? Times{} : Times{median(factorize), median(solve)};
}

void bench(Registry& registry, const DumpedSystem& system, const std::string& name, const SolverOptions& options,
           Repeats repeats, const std::string& after) {
  std::vector<double> x(system.rhs.size());
  const auto solver = registry.create(name, options);
  Outcome outcome = Outcome::ok;
  double residual = 1;
  Profile profile;
  const auto keep_worst = [&](Outcome next) { outcome = outcome == Outcome::ok ? next : outcome; };
  const auto factorize_and_solve = [&] {
    const Profile::Active active(&profile);
    return measure([&] { keep_worst(solver->factorize(system.values)); },
                   [&] {
                     const SolveReport report = solver->solve(system.rhs, x, 1, kAskedResidual);
                     keep_worst(report.outcome);
                     residual = report.relative_residual;
                   });
  };
  AnalyzeHints hints = system.hints();
  if (!after.empty()) {
    const DumpedSystem other = read_system(after);
    keep_worst(solver->analyze(other.pattern, other.hints()));
    hints.may_keep_order = true;
  }
  const double start = seconds_now();
  keep_worst(solver->analyze(system.pattern, hints));
  const double analyze = seconds_now() - start;
  std::vector<Times> checked, bare;
  std::vector<double> overheads;  // of checks, copies, residuals and refinement, over the engine alone just before
  if (repeats != Repeats::none && outcome == Outcome::ok) checked.push_back(factorize_and_solve());
  if (repeats == Repeats::some && outcome == Outcome::ok) {
    const auto engine = registry.create_engine(name, options);
    if (engine) engine->analyze(system.pattern, system.hints());
    for (double spent = 0; spent < 0.5 || checked.size() < 3; spent += checked.back().sum()) {
      if (engine)
        bare.push_back(measure([&] { engine->factorize(system.values); }, [&] { engine->solve(system.rhs, x, 1); }));
      checked.push_back(factorize_and_solve());
      if (engine) overheads.push_back(checked.back().sum() / bare.back().sum() - 1);
    }
  }
  const Times own = median(checked), library = median(bare);
  const Statistics statistics = solver->statistics();
  std::string phases;
  for (const PhaseTimes& phase : profile.take())
    if (phase.name == "factorise" || phase.name == "solve")
      phases += fmt::format(", \"{0}_work_s\": {1:.4g}, \"{0}_span_s\": {2:.4g}", phase.name, phase.work / checked.size(),
                            phase.span / checked.size());
  fmt::print(
      "{{\"solver\": \"{}\", \"unknowns\": {}, \"nonzeros\": {}, \"outcome\": \"{}\", \"analyze_s\": {:.4g}, "
      "\"factorize_s\": {:.4g}, \"solve_s\": {:.4g}, \"bare_factorize_s\": {:.4g}, \"bare_solve_s\": {:.4g}, "
      "\"overhead\": {}, "
      "\"factor_nonzeros\": {:.6g}, \"factor_mb\": {:.4g}, \"largest_rank_mb\": {:.4g}, \"flops\": {:.4g}, "
      "\"iterations\": {}, \"residual\": {}{}}}\n",
      name, system.pattern.order, system.pattern.nonzeros(), to_string(outcome), analyze, own.factorize, own.solve,
      library.factorize, library.solve, overheads.empty() ? "null" : fmt::format("{:.4f}", median(overheads)),
      statistics.factor_nonzeros, statistics.factor_bytes / 1e6, statistics.largest_bytes / 1e6, statistics.flops,
      statistics.iterations, std::isfinite(residual) ? fmt::format("{:.2e}", residual) : "null", phases);
  if (outcome != Outcome::ok) fmt::print(stderr, "{}: {}\n", name, solver->message());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) {
    fmt::print(stderr,
               "usage: itr_solver_bench SYSTEM SOLVER [--analyze | --once] [--after OTHER] [--threads N] [KEY=VALUE]...\n");
    return 2;
  }
  try {
    SolverOptions options;
    Repeats repeats = Repeats::some;
    std::string after;
    int threads = 0;
    for (int i = 3; i < argc; ++i) {
      const std::string text = argv[i];
      if (text == "--analyze" || text == "--once") {
        repeats = text == "--once" ? Repeats::once : Repeats::none;
        continue;
      }
      if (text == "--after" && i + 1 < argc) {
        after = argv[++i];
        continue;
      }
      if (text == "--threads" && i + 1 < argc) {
        threads = std::stoi(argv[++i]);
        continue;
      }
      const auto equals = text.find('=');
      if (equals == std::string::npos) throw InputError({"", "option", text, "KEY=VALUE"});
      options[text.substr(0, equals)] = text.substr(equals + 1);
    }
    const ThreadLimit limit(threads);
    Registry registry;
    registry.allow_mpi_start();
    const std::string solver = Registry::canonical_name(argv[2]);
    if (cli::this_launch().rank > 0) return cli::serve(registry, solver);
    const cli::RankSession session(registry, solver);
    bench(registry, read_system(argv[1]), solver, options, repeats, after);
    return 0;
  } catch (const InputError& error) {
    fmt::print(stderr, "itr_solver_bench: {}\n", error.what());
    return 2;
  }
}
