// SPDX-License-Identifier: MIT
#include "run.hpp"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>

#include "itr/core/parallel.hpp"
#include "itr/core/timer.hpp"
#include "itr/linear/choice.hpp"
#include "itr/output/writer.hpp"
#include "itr/simulation/simulation.hpp"
#include "ranks.hpp"

namespace itr::cli {

namespace {

volatile std::sig_atomic_t interrupted = 0;
void on_interrupt(int) { interrupted = 1; }

Logger make_logger() {
  return Logger([](LogLevel level, std::string_view message) {
    switch (level) {
      case LogLevel::debug:
        spdlog::debug("{}", message);
        break;
      case LogLevel::info:
        spdlog::info("{}", message);
        break;
      case LogLevel::warning:
        spdlog::warn("{}", message);
        break;
    }
  });
}

void show_progress(const StepReport& report, int steps) {
  const std::string line =
      fmt::format("step {}/{}  t = {:.6g} s  {} vertices  {} Newton iterations  total {:.6g} J  {:.3g} s", report.step,
                  steps, report.t, report.vertices, report.newton_iterations, report.energy.total, report.seconds.total);
  if (isatty(STDOUT_FILENO)) {
    fmt::print("\r\033[K{}", line);
    std::fflush(stdout);
  } else {
    spdlog::info("{}", line);
  }
}

template <int Dim>
int simulate(Setup<Dim> setup, const scene::Scene& scene, const std::string& directory, const RunOptions& options,
             int threads, linear::Registry& registry) {
  Simulation<Dim> simulation(std::move(setup), registry, make_logger());
  output::Writer writer(directory, scene.output, {options.scene.string(), simulation.solver_name(), threads});
  double output_seconds = 0;
  const auto write = [&](StepReport report) {
    report.seconds.output = output_seconds;  // of the frame before: this one is not written yet
    report.seconds.total += output_seconds;
    output_seconds = 0;
    const ScopedTimer timer(output_seconds);
    simulation.observe([&](const FrameView<Dim>& frame) { writer.write(frame, report); });
  };
  write(simulation.initial_report());
  std::signal(SIGINT, on_interrupt);
  std::signal(SIGTERM, on_interrupt);
  const int steps = simulation.setup().time.steps;
  std::string outcome = "finished";
  while (!simulation.finished()) {
    const StepResult result = simulation.advance();
    if (!result.ok) {
      outcome = fmt::format("stopped in step {} (t = {:.6g} s): {}", simulation.state().step + 1,
                            simulation.state().t + simulation.setup().time.dt, result.reason);
      break;
    }
    write(result.report);
    show_progress(result.report, steps);
    if (interrupted) {
      outcome = fmt::format("interrupted after step {}", simulation.state().step);
      break;
    }
  }
  writer.finish(outcome);
  if (isatty(STDOUT_FILENO)) fmt::print("\n");
  if (outcome == "finished") {
    fmt::print("{} steps in {}\n", simulation.state().step, directory);
    return done;
  }
  fmt::print(stderr, "itr: {}; the last good state is in {}\n", outcome, directory);
  return simulation_stopped;
}

}  // namespace

int run(const RunOptions& options) {
  scene::Scene scene = scene::read(options.scene, options.overrides);
  for (const auto& warning : scene.warnings) spdlog::warn("{}", warning);
  std::string directory = options.directory.empty() ? scene.directory : options.directory;
  if (directory.empty()) directory = (std::filesystem::path("results") / options.scene.stem()).string();
  const int threads = options.threads >= 0 ? options.threads : scene.max_threads;
  const ThreadLimit limit(threads);
  linear::Registry registry;
  registry.allow_mpi_start();
  return std::visit(
      [&](auto& setup) {
        if (!options.solver.empty()) setup.linear.solvers = {options.solver};
        setup.linear.dump_folder = options.dump_folder;
        setup.linear.dump_every = options.dump_every;
        const std::string solver = linear::choose_name(setup.linear, registry);
        if (this_launch().rank > 0) return serve(registry, solver);
        const RankSession session(registry, solver);
        return simulate(std::move(setup), scene, directory, options, num_threads(), registry);
      },
      scene.setup);
}

}  // namespace itr::cli
