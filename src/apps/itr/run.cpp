// SPDX-License-Identifier: MIT
#include "commands.hpp"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <cstdio>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <stop_token>
#include <thread>
#include <utility>

#include "accuracy.hpp"
#include "advice.hpp"
#include "core/parallel.hpp"
#include "core/process.hpp"
#include "core/profile.hpp"
#include "core/read_file.hpp"
#include "core/timer.hpp"
#include "error_bars.hpp"
#include "itr/core.hpp"
#include "itr/output.hpp"
#include "output/force_file.hpp"
#include "output/profile_file.hpp"
#include "output/warnings.hpp"
#include "ranks.hpp"
#include "simulation/state.hpp"
#include "simulation/step.hpp"

namespace itr::cli {

namespace {

// Any thread may be the one that handles a signal.
std::atomic<bool> interrupted = false, terminated = false;
std::atomic<bool> stop_now = false;  // what a solve looks at

template <std::size_t N>
void say(const char (&text)[N]) {  // all that a signal's handler may do
  [[maybe_unused]] const auto written = ::write(STDERR_FILENO, text, N - 1);
}

/// As batch systems send it, with little time left: the step is dropped, and the state before it is saved.
void on_termination(int) {
  if (!stop_now) say("\nitr: dropping the step\n");
  interrupted = terminated = true;
  stop_now = true;
}

/// The step is finished and saved; the second signal drops it, and the third is the system's.
void on_interrupt(int signal) {
  if (!interrupted) {
    interrupted = true;
    return say("\nitr: finishing the step; again to stop now\n");
  }
  stop_now = true;
  say("\nitr: dropping the step\n");
  std::signal(signal, SIG_DFL);
}

/// Says warnings, and keeps them for the results' files. While a step that goes on is dropped, two threads do so.
class Warnings {
 public:
  /// Says it after "warning:" where it is the first of its kind.
  void add(std::string_view text) {
    const std::scoped_lock guard(lock_);
    if (said_.insert(output::kind_of_warning(text)).second) spdlog::warn("warning: {}", text);
    kept_.emplace_back(text);
  }
  /// Returns those that have come since the last call.
  std::vector<std::string> take() {
    const std::scoped_lock guard(lock_);
    return std::exchange(kept_, {});
  }

 private:
  std::mutex lock_;
  std::vector<std::string> kept_;
  std::set<std::string> said_;  ///< kinds
};

Logger make_logger(Warnings& warnings) {
  return Logger([&warnings](LogLevel level, std::string_view message) {
    if (level == LogLevel::warning) return warnings.add(message);
    spdlog::log(level == LogLevel::debug ? spdlog::level::debug : spdlog::level::info, "{}", message);
  });
}

std::string describe_seconds(double seconds) {
  if (seconds < 60) return fmt::format("{:.0f} s", seconds);
  if (seconds < 3600) return fmt::format("{:.0f} min", seconds / 60);
  return fmt::format("{:.1f} h", seconds / 3600);
}

/// `left`: time that the steps to come take if they take as long as those so far [s].
void show_progress(const StepReport& report, const Units& units, const TimeOptions& time, double left) {
  const std::string of = time.adaptive.enabled ? "" : fmt::format("/{}", time.steps);
  const std::string dt = time.adaptive.enabled ? "  dt = " + units.text(report.dt, "s", 3) : "";
  const std::string line =
      fmt::format("step {}{}  t = {}{}  {} vertices  {} Newton iterations  total {}  {:.3g} s  {} left", report.step, of,
                  units.text(report.t, "s", 6), dt, report.vertices, report.newton_iterations,
                  units.text(report.energy.total, "J", 6), report.seconds.total, describe_seconds(left));
  if (isatty(STDOUT_FILENO)) {
    fmt::print("\r\033[K{}", line);
    std::fflush(stdout);
  } else {
    spdlog::info("{}", line);
  }
}

/// How many candidates were refused, by reason.
std::string describe_refusals(const OperationCount& count, const char* name) {
  std::string text;
  for (int i = 0; i < kRefusals; ++i)
    if (count.refused[i] > 0)
      text += fmt::format("{} {} {}", text.empty() ? fmt::format("; {} refused:", name) : ",", count.refused[i],
                          itr::name(static_cast<Refusal>(i)));
  return text;
}

/// Says how much remeshing did, and where it did nothing why.
std::string describe_remeshing(const StepReport& totals, const Units& units, int vertices_before) {
  const std::pair<const OperationCount&, const char*> operations[] = {
      {totals.splits, "splits"},       {totals.curves, "curved edges"}, {totals.straightens, "straightened"},
      {totals.collapses, "collapses"}, {totals.swaps, "swaps"},         {totals.smooths, "moves"}};
  std::string done = fmt::format("remeshing: {} vertices at the start, {} at the end", vertices_before, totals.vertices),
              refusals;
  int accepted = 0;
  for (const auto& [count, name] : operations) {
    const bool is_split = &count == &totals.splits;
    if (count.tried > 0 || is_split)
      done += fmt::format("{} {} of {} {}", is_split ? ";" : ",", count.accepted, count.tried, name);
    refusals += describe_refusals(count, name);
    accepted += count.accepted;
  }
  done += refusals;
  if (accepted > 0) return done;
  const std::string bound = totals.bound_by_dhat > 0
                                ? fmt::format("; d-hat kept {} surface edges from being split", totals.bound_by_dhat)
                                : std::string();
  const auto was_refused = [](const OperationCount& c) {
    return std::any_of(c.refused.begin(), c.refused.end(), [](int n) { return n > 0; });
  };
  if (!was_refused(totals.splits) && was_refused(totals.curves))  // splits are not enabled
    return done + "; accepted nothing; a smaller /space/remesh/curve/acceptance_tolerance curves more edges";
  if (totals.splits.tried == 0 && totals.best_refused_split == 0)
    return done + fmt::format("; accepted nothing, because no body ever stored the {} that a split has to gain{}",
                              units.text(totals.split_tolerance, "J", 2), bound);
  return done + fmt::format(
                    "; accepted nothing, because no split promised more than {} and it has to gain {}{}; "
                    "a smaller /space/remesh/split/acceptance_tolerance refines more",
                    units.text(totals.best_refused_split, "J", 2), units.text(totals.split_tolerance, "J", 2), bound);
}

/// Says what steps were chosen, and what they add to the error.
std::string describe_steps(const StepReport& totals, const AdaptiveTimeOptions& options) {
  return fmt::format(
      "steps for a /time/tolerance of {:g}: {} taken, {} rejected (see steps.jsonl); "
      "the estimates of their errors sum up to {:.2g} % of the motion in the energy norm",
      options.tolerance, totals.step, totals.rejected_steps, 100 * totals.time_error);
}

std::string describe_solves(const StepReport& totals) {
  std::string text = fmt::format("{} Newton iterations, {} linear systems, {} factorizations", totals.newton_iterations,
                                 totals.linear_solves, totals.factorizations);
  if (totals.reused_factors > 0)
    text +=
        fmt::format("; earlier factors solved {} systems in {} iterations", totals.reused_factors, totals.linear_iterations);
  return text;
}

/// Which changes of the scene a run that goes on allows. Throws InputError for the others.
void check_changes(const std::vector<scene::Change>& changes, const RunOptions& options, const output::SavedState& saved) {
  using Of = scene::Change::Of;
  std::string text;
  bool could_be_allowed = true;
  for (const auto& change : changes) {
    if (change.of == Of::length || (change.of == Of::solving && options.allow_changes)) {
      spdlog::info("another scene than before: {}", change.text);
      continue;
    }
    text += "\n  " + change.text;
    could_be_allowed = could_be_allowed && change.of == Of::solving;
  }
  if (text.empty()) return;
  throw InputError({options.scene.string(), "--resume", "another scene than that of the saved state:" + text,
                    fmt::format("the scene of {}{}", saved.file.string(),
                                could_be_allowed ? ", or --allow-changes: these are of how steps are solved"
                                                 : "; /time/tend may change, and with --allow-changes /time/step_cuts, "
                                                   "/time/tolerance, dt_min and dt_max, /solver and /space/remesh")});
}

/// Throws InputError where new results would be in other units than those of the folder.
void check_units(const Units& units, const RunOptions& options, const output::SavedState& saved) {
  const auto names = [](const Units& of) { return "results in " + of.length() + ", " + of.mass() + ", " + of.time(); };
  if (names(units) != names(saved.units))
    throw InputError({options.scene.string(), "/output/units", names(units),
                      names(saved.units) + ", as in " + saved.file.string() + ", or another folder (-o)"});
}

/// The state to go on from; none without --resume or where the folder has no frames.
std::optional<output::SavedState> find_resumable(const output::Folder& folder, const RunOptions& options) {
  const std::string directory = folder.path().string();
  if (!options.resume) {
    if (!options.overwrite && folder.has_results())
      throw InputError({directory, "output folder", "results of an earlier run",
                        "--overwrite to replace them, --resume to go on, or another folder (-o)"});
    return std::nullopt;
  }
  auto saved = output::find_saved_state(directory);
  if (!saved) spdlog::info("no saved state in {}: starting from the beginning", directory);
  return saved;
}

/// The one to try where `saved` is damaged.
std::optional<output::SavedState> find_older(const std::string& directory, const output::SavedState& saved) {
  try {
    return output::find_saved_state(directory, saved.step);
  } catch (const InputError&) {
    return std::nullopt;
  }
}

/// Names of what the folder gets beside what each run writes.
template <int Dim>
std::vector<std::string> further_files(const Setup<Dim>& setup, const RunOptions& options) {
  std::vector<std::string> names;
  if (!setup.fields.curves.empty()) names.emplace_back(output::kForceFile);
  if (!setup.fields.points.empty()) names.emplace_back(output::kPointFile);
  if (options.profile) names.emplace_back(output::kProfileFile);
  if (options.report) names.emplace_back(kReportFile);
  return names;
}

/// Opens a lock while it lives.
class Unlocked {
 public:
  explicit Unlocked(std::unique_lock<std::mutex>& lock) : lock_(lock) { lock_.unlock(); }
  Unlocked(const Unlocked&) = delete;
  Unlocked& operator=(const Unlocked&) = delete;
  ~Unlocked() { lock_.lock(); }

 private:
  std::unique_lock<std::mutex>& lock_;
};

template <int Dim>
class Run {
 public:
  Run(Setup<Dim> setup, const scene::Scene& scene, output::Folder folder, const RunOptions& options, int threads,
      linear::Registry& registry, Warnings& warnings, double start)
      : directory_(folder.path().string()),
        with_report_(options.report),
        writes_beside_(threads > 1),
        warnings_(warnings),
        units_(scene.output.units),
        simulation_(std::move(setup), registry, make_logger(warnings)),
        accuracy_(scene.accuracy, simulation_.setup().time, simulation_.setup().remesh,
                  simulation_.setup().depends_on_path()) {
    for (const auto& warning : find_suspicious(simulation_)) warnings.add(warning);
    const output::RunInfo info{options.scene.string(),
                               simulation_.solver_name(),
                               threads,
                               scene.identity,
                               start,
                               further_files(simulation_.setup(), options),
                               scene.defaults.name,
                               simulation_.interference_energy()};
    const auto saved = find_resumable(folder, options);
    std::signal(SIGINT, on_interrupt);  // from here on files are written
    std::signal(SIGTERM, on_termination);
    writer_ = saved
                  ? std::make_unique<output::Writer>(std::move(folder), scene.output, info, restore(*saved, scene, options))
                  : std::make_unique<output::Writer>(std::move(folder), scene.output, info);
    if (options.profile) profile_.emplace(directory_, threads);
    if (const int count = writer_->removed_files(); count > 0)
      spdlog::info("removed from {}: {} files of {}", directory_, count,
                   saved ? "the run that goes on, written after this state or at its end" : "an earlier run, and no others");
    is_saved_ = saved.has_value();
    if (saved) {
      spdlog::info("going on after step {}", simulation_.steps());
      if (accuracy_.is_asked()) {
        accuracy_.go_on(read_file(std::filesystem::path(directory_) / "steps.jsonl").value_or(""),
                        simulation_.setup().units);
        simulation_.conditions().remesh.relative_tolerance = accuracy_.relative_tolerance();
      }
    } else {
      write(simulation_.report());
    }
  }

  int run() {
    std::string outcome, advice = "`itr run` with --resume goes on from the last saved state in " + directory_;
    std::unique_lock at_output(output_);
    const std::jthread watching([this, advice](const std::stop_token& end) { watch(end, advice); });
    try {
      outcome = advance(at_output, advice);
      finish_frame();
      if (outcome != kFinished && !is_saved_) save();
      writer_->add_output(std::exchange(output_seconds_, 0));
      writer_->finish(outcome, simulation_.solver_name_in_use());
    } catch (const InputError& error) {  // of the output: what is on the disk stays as it is
      const std::string of_output =
          fmt::format("step {}, whose files could not all be written: {}", frame_step_, error.what());
      outcome = outcome.empty() || outcome == kFinished ? "stopped at " + of_output : outcome + "; and at " + of_output;
    }
    if (isatty(STDOUT_FILENO)) fmt::print("\n");
    const bool is_finished = outcome == kFinished;
    const Setup<Dim>& setup = simulation_.setup();
    if (is_finished) fmt::print("{} steps in {}: {}\n", simulation_.steps(), directory_, describe_solves(writer_->totals()));
    if (is_finished && setup.time.adaptive.enabled)
      fmt::print("{}\n", describe_steps(writer_->totals(), setup.time.adaptive));
    if (is_finished && setup.remesh.enabled)
      fmt::print("{}\n", describe_remeshing(writer_->totals(), setup.units, setup.mesh.num_vertices()));
    if (is_finished && setup.fields.error_bars)
      for (const std::string& line :
           describe_errors(setup.fields.curves.empty() ? "" : output::stored_forces(directory_), writer_->totals(), units_))
        fmt::print("{}\n", line);
    if (is_finished && accuracy_.is_asked())
      fmt::print("{}\n",
                 accuracy_.describe(setup.fields.curves.empty() ? "" : output::stored_forces(directory_),
                                    setup.fields.points.empty()
                                        ? ""
                                        : read_file(std::filesystem::path(directory_) / output::kPointFile).value_or("")));
    if (const int count = writer_->warnings(); count > 0)
      spdlog::warn("{} warning{}: see above, or summary.json in {}", count, count == 1 ? "" : "s", directory_);
    if (with_report_) write_report();
    if (is_finished) return done;
    fmt::print(stderr, "itr: {}; {}\n", outcome, advice);
    return simulation_stopped;
  }

 private:
  static constexpr const char* kFinished = "finished";
  static constexpr std::chrono::milliseconds kLook{100};  ///< between looks at what a signal said
  static constexpr double kGrace = 5;                     ///< for a step that is to be dropped [s]

  /// Takes the newest state that is whole: `saved`, or one before it where it is damaged.
  output::Checkpoint<Dim> restore(output::SavedState saved, const scene::Scene& scene, const RunOptions& options) {
    output::Checkpoint<Dim> checkpoint = read_whole(saved, scene, options);
    try {
      simulation_.restore(*checkpoint.state);
    } catch (const InputError& error) {  // older states would fit no better, and their steps would replace good results
      throw InputError({saved.file.string(), error.parts().place, error.parts().found, error.parts().expected});
    }
    return checkpoint;
  }

  output::Checkpoint<Dim> read_whole(output::SavedState& saved, const scene::Scene& scene, const RunOptions& options) {
    for (std::optional<InputError> newest;;) {
      for (const std::string& text : saved.passed_over) spdlog::warn("a frame cannot be read, going further back: {}", text);
      check_changes(scene::find_changes(saved.scene, scene.identity), options, saved);
      check_units(scene.output.units, options, saved);
      if (saved.backend != simulation_.solver_name() && !options.allow_changes)
        throw InputError({directory_, "--resume", "solver " + simulation_.solver_name(),
                          saved.backend + ", as before, or --allow-changes"});
      try {
        return output::read_checkpoint<Dim>(saved);
      } catch (const InputError& error) {
        if (!newest) newest = error;
        auto older = find_older(directory_, saved);
        if (!older) throw InputError(*newest);
        spdlog::warn("the state saved in {} cannot be used, going back to step {}: {}", saved.file.string(), older->step,
                     error.what());
        saved = std::move(*older);
      }
    }
  }

  /// Ends the process where a terminated step goes on: a factorisation, say, cannot be interrupted. The state before the
  /// step is saved first.
  void watch(const std::stop_token& end, const std::string& advice) {
    std::mutex mutex;
    std::condition_variable_any none;
    std::unique_lock waiting(mutex);
    std::optional<double> since;
    while (!none.wait_for(waiting, end, kLook, [&] { return end.stop_requested(); })) {
      if (!terminated) continue;
      if (!since) since = seconds_now();
      if (seconds_now() - *since < kGrace) continue;
      if (const std::unique_lock in_step(output_, std::try_to_lock); in_step) drop_step(advice);
    }
  }

  [[noreturn]] void drop_step(const std::string& advice) {
    std::string outcome = fmt::format("interrupted in step {}, which is dropped", before_.state->step + 1);
    try {
      finish_frame();
      if (!is_saved_)
        simulation_.observe(before_, [&](const FrameView<Dim>& frame) { writer_->save(frame, *before_.state); });
      writer_->add_output(std::exchange(output_seconds_, 0));
      writer_->finish(outcome, "");
    } catch (const InputError& error) {
      outcome += fmt::format("; its files could not all be written: {}", error.what());
    }
    fmt::print(stderr, "itr: {}; {}\n", outcome, advice);
    std::fflush(nullptr);
    std::_Exit(simulation_stopped);
  }

  /// The largest kinetic, elastic and contact energy at the end of a step so far [J].
  double largest_energy() {
    const State<Dim>& state = simulation_.state();
    const TimeOptions& time = simulation_.setup().time;
    if (time.has_inertia() && !time.adaptive.enabled)
      simulation_.observe([&](const FrameView<Dim>& frame) {
        const EnergyReport& energy = simulation_.report().energy;
        largest_energy_ = std::max(largest_energy_, energy.elastic + energy.contact + frame.asked->kinetic_energy.at(0));
      });
    return std::max({state.stored_energy, state.control.energy, largest_energy_});
  }

  /// Takes a step, and as long as its error bar asks for it, again on a finer mesh; from what was there, where that fails.
  StepResult take_step() {
    StepResult result = simulation_.advance();
    if (!accuracy_.is_asked()) return result;
    RemeshOptions& remesh = simulation_.conditions().remesh;
    while (result.ok) {
      const auto finer = accuracy_.finer(result.report, largest_energy(), simulation_.finished());
      if (!finer) break;
      const Snapshot<Dim> coarse = simulation_.save();
      simulation_.restore(before_);
      remesh.relative_tolerance = *finer;
      StepResult again = simulation_.advance();
      if (!again.ok) {
        simulation_.restore(coarse);
        break;
      }
      add_dropped(std::move(result.report), again.report);
      result = std::move(again);
    }
    if (!result.ok) return result;
    accuracy_.add(result.report, largest_energy());
    remesh.relative_tolerance = accuracy_.relative_tolerance();
    return result;
  }

  /// Until the end or until something stops it; says what, and in `advice` what can be done. Only while it is in a step, the
  /// output is not `at_output`.
  std::string advance(std::unique_lock<std::mutex>& at_output, std::string& advice) {
    const TimeOptions& time = simulation_.setup().time;
    const Units& units = simulation_.setup().units;
    while (!simulation_.finished()) {
      before_ = simulation_.save();
      const StepResult result = [&] {
        const Unlocked while_stepping(at_output);
        try {
          return take_step();
        } catch (const InputError& error) {  // a value of the scene that is none at this time or place
          StepResult failed;
          failed.ok = false;
          failed.reason = error.what();
          return failed;
        }
      }();
      if (!result.ok && stop_now) return fmt::format("interrupted in step {}, which is dropped", simulation_.steps() + 1);
      if (!result.ok) {
        advice = fmt::format(
            "the state before it is saved in {}. To go on, change how steps are solved: `itr run` with --resume "
            "--allow-changes and {}, more /solver/nonlinear/max_iterations, or another tolerance or solver{}",
            directory_,
            time.adaptive.enabled ? "a smaller /time/dt_min" : "--set /time/step_cuts=8 (smaller steps where one fails)",
            time.adaptive.enabled ? "" : "; a smaller /time/dt needs a new run");
        return fmt::format("stopped in step {} (t = {}): {}", simulation_.steps() + 1,
                           units.text(simulation_.time() + simulation_.setup().time.dt, "s", 6), result.reason);
      }
      write(result.report);
      if (profile_) profile_->add(result.report.step);
      ++steps_done_;
      const double steps_left =
          time.adaptive.enabled ? (time.adaptive.end - result.report.t) / result.report.dt : time.steps - result.report.step;
      show_progress(result.report, units, time, (seconds_now() - start_) / steps_done_ * steps_left);
      if (interrupted && !simulation_.finished()) return fmt::format("interrupted after step {}", simulation_.steps());
    }
    return kFinished;
  }

  void write_report() const {
    try {
      report(directory_, "", {});
    } catch (const InputError& error) {  // the run is what it is without
      spdlog::warn("no report: {}", error.what());
    }
  }

  /// Writes the step's files; with several threads beside the next step, so that two frames at most are in memory. Throws
  /// InputError where those of the step before could not be written.
  void write(StepReport report) {
    const auto phase = ScopedPhase::beside("output");
    finish_frame();
    report.seconds.output = output_seconds_;  // of the frame before: this one is not written yet
    report.seconds.total += output_seconds_;
    output_seconds_ = 0;
    const ScopedTimer timer(output_seconds_);
    frame_step_ = report.step;
    is_saved_ = simulation_.finished() || interrupted || writer_->is_checkpoint_due(simulation_.steps(), simulation_.time());
    const auto store = [this, report, snapshot = simulation_.save(), is_saved = is_saved_] {
      simulation_.observe(snapshot, [&](const FrameView<Dim>& frame) {
        writer_->write(frame, report, is_saved ? snapshot.state.get() : nullptr);
      });
    };
    if (!writes_beside_) return store();
    frame_ = std::async(std::launch::async, store);
  }

  /// Waits for the frame that is being written, then gives its writer the warnings since. Throws InputError where it could
  /// not be written.
  void finish_frame() {
    const ScopedTimer timer(output_seconds_);
    if (frame_.valid()) frame_.wait();
    for (const std::string& text : warnings_.take()) writer_->warn(text);
    if (frame_.valid()) frame_.get();
  }

  void save() {
    simulation_.observe([&](const FrameView<Dim>& frame) { writer_->save(frame, simulation_.state()); });
  }

  std::string directory_;
  bool with_report_, writes_beside_;
  Warnings& warnings_;
  Units units_;  ///< of results
  Simulation<Dim> simulation_;
  AccuracyWatch accuracy_;
  std::unique_ptr<output::Writer> writer_;
  std::optional<output::ProfileFile> profile_;
  double output_seconds_ = 0;
  double start_ = seconds_now();
  int steps_done_ = 0;
  double largest_energy_ = 0;  ///< of steps whose lengths the scene sets [J]
  bool is_saved_ = false;      ///< whether the present state is
  std::mutex output_;          ///< of the writer and of what is below
  Snapshot<Dim> before_;       ///< the state that the step begins with
  int frame_step_ = 0;         ///< of the frame that was written last, or is being written
  std::future<void> frame_;    ///< being written
};

/// Reads the scene anew where it asks for no defaults, with those that the run it goes on with had.
void keep_defaults(const std::string& directory, const RunOptions& options, scene::Scene& scene) {
  if (scene.defaults.is_asked_for || !std::filesystem::exists(directory)) return;
  const auto saved = output::find_saved_state(directory);
  const std::string name = saved ? scene::defaults_of(saved->scene) : "";
  if (name.empty() || name == scene.defaults.name) return;
  std::vector<scene::Override> overrides = options.overrides;
  overrides.push_back({"/defaults", '"' + name + '"'});
  scene = scene::read(options.scene, overrides);
  spdlog::info("defaults: {}, as before", name);
}

}  // namespace

int run(const RunOptions& options) {
  const double start = seconds_now();
  scene::Scene scene = scene::read(options.scene, options.overrides);
  std::string directory = options.directory.empty() ? scene.directory : options.directory;
  if (directory.empty()) directory = (std::filesystem::path("results") / options.scene.stem()).string();
  if (options.resume) keep_defaults(directory, options, scene);
  Warnings warnings;
  for (const auto& warning : scene.warnings) warnings.add(warning);
  for (const std::string& line : describe_accuracy(scene.accuracy)) spdlog::info("{}", line);
  if (!scene.defaults.information.empty()) spdlog::info("{}", scene.defaults.information);
  const int threads = options.threads >= 0 ? options.threads : scene.max_threads;
  const ThreadLimit limit(threads);
  if (const int ranks = this_launch().ranks, cores = available_cores();
      ranks > 1 && ranks - 1 + threads > cores && threads > 0)
    warnings.add(
        fmt::format("{} ranks, of which the first has {} threads, on {} cores: they wait for each other (--threads)", ranks,
                    threads, cores));
  linear::Registry registry;
  registry.allow_mpi_start();
  return std::visit(
      [&](auto& setup) {
        setup.newton.cancel = &stop_now;
        const SolverChoice solver = choose_solver(setup.linear, options, registry);
        if (this_launch().rank > 0) return serve(registry, solver.name);
        for (const auto& warning : solver.warnings) warnings.add(warning);
        const RankSession session(registry, solver.name);
        return Run(std::move(setup), scene, output::Folder(directory), options, num_threads(), registry, warnings, start)
            .run();
      },
      scene.setup);
}

}  // namespace itr::cli
