// SPDX-License-Identifier: MIT
// Nothing is lost: the command is killed, interrupted and denied its disk, and goes on to the same end, bit for bit.
#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>
#include <thread>

#include "core/hdf5.hpp"
#include "itr/core/error.hpp"
#include "itr/output/checkpoint.hpp"
#include "itr/scene/scene.hpp"
#include "output/certify.hpp"
#include "output/frame_file.hpp"

namespace itr::output {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Arguments = std::vector<std::string>;

std::string text_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

int count_lines(const fs::path& path) {
  const std::string text = text_of(path);
  return static_cast<int>(std::count(text.begin(), text.end(), '\n'));
}

/// `itr run`, or another command, its output in a file.
class Command {
 public:
  /// `largest_file` [bytes]: writes beyond fail, as those on a full disk do; 0: no limit.
  Command(const Arguments& arguments, const fs::path& log, rlim_t largest_file = 0, const Arguments& command = {"run"})
      : log_(log) {
    std::vector<std::string> words = {std::string(ITR_BINARY_DIR) + "/bin/itr"};
    for (const Arguments* part : {&command, &arguments}) words.insert(words.end(), part->begin(), part->end());
    std::vector<char*> argv;
    for (auto& word : words) argv.push_back(word.data());
    argv.push_back(nullptr);
    pid_ = fork();
    if (pid_ != 0) return;
    const int out = open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0666);
    dup2(out, STDOUT_FILENO);
    dup2(out, STDERR_FILENO);
    if (const rlimit limit = {largest_file, largest_file}; largest_file) setrlimit(RLIMIT_FSIZE, &limit);
    execv(argv[0], argv.data());
    _exit(127);
  }

  void send(int signal) const { kill(pid_, signal); }
  /// Exit status, or minus the signal that ended it.
  int wait() const {
    int status = 0;
    waitpid(pid_, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }
  std::string said() const { return text_of(log_); }

 private:
  fs::path log_;
  pid_t pid_ = 0;
};

struct Case {
  const char* name;
  const char* scene;  ///< in examples/
  int steps;
  std::string time;  ///< the rest of /time
  Arguments sets;
};

std::ostream& operator<<(std::ostream& out, const Case& value) { return out << value.name; }

class InterruptTest : public ::testing::Test {
 protected:
  InterruptTest() {
    std::string name = ::testing::UnitTest::GetInstance()->current_test_info()->name();
    std::replace(name.begin(), name.end(), '/', '-');
    folder = fs::path(ITR_BINARY_DIR) / "tests" / "resume" / name;
    fs::remove_all(folder);
    fs::create_directories(folder);
  }

  Arguments arguments(const Case& which, const fs::path& directory, double checkpoint_period, bool resume = false) const {
    Arguments words = {fmt::format("{}/examples/{}", ITR_SOURCE_DIR, which.scene), "-o", directory.string(), "--threads",
                       "1"};
    Arguments sets = which.sets;
    sets.push_back(fmt::format(R"(/time={{"time_steps":{},{}}})", which.steps, which.time));
    sets.push_back(fmt::format("/output/checkpoint_period={}", checkpoint_period));
    for (const auto& set : sets) words.insert(words.end(), {"--set", set});
    if (resume) words.push_back("--resume");
    return words;
  }

  Command start(const Arguments& words) const { return Command(words, folder / "log"); }

  /// Lets it run until steps.jsonl has that many lines, then sends the signal.
  static int stop_at(const Command& command, const fs::path& directory, int lines, int signal) {
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (count_lines(directory / "steps.jsonl") < lines && std::chrono::steady_clock::now() < deadline)
      std::this_thread::sleep_for(std::chrono::microseconds(200));
    command.send(signal);
    return command.wait();
  }

  fs::path folder;
};

class ResumeTest : public InterruptTest, public ::testing::WithParamInterface<Case> {};

/// steps.jsonl without what depends on the machine's mood.
std::vector<Json> results_of(const fs::path& directory) {
  std::vector<Json> lines;
  std::istringstream text(text_of(directory / "steps.jsonl"));
  for (std::string line; std::getline(text, line);) {
    lines.push_back(Json::parse(line));
    lines.back().erase("seconds");
    lines.back().erase("processor_seconds");
    lines.back().erase("peak_rss_mb");
    lines.back().erase("trial_seconds");
    lines.back().erase("warnings");  // each is said again after --resume
  }
  return lines;
}

void expect_same_bits(const hdf5::File& a, const hdf5::File& b, const std::string& frame) {
  for (const char* name : {"/mesh/rest", "/fields/x", "/fields/u", "/fields/v", "/fields/elastic_density", "/obstacles/x"}) {
    const auto x = a.read_doubles(frame + name).values, y = b.read_doubles(frame + name).values;
    ASSERT_EQ(x.size(), y.size()) << frame << name;
    EXPECT_TRUE(x.empty() || std::memcmp(x.data(), y.data(), x.size() * sizeof(double)) == 0) << frame << name;
  }
  for (const char* name : {"/mesh/simplices", "/mesh/body", "/mesh/surface"})
    EXPECT_EQ(a.read_integers(frame + name).values, b.read_integers(frame + name).values) << frame << name;
}

/// Through sim.h5, so that its links are tried too.
void expect_same_results(const fs::path& a, const fs::path& b) {
  EXPECT_EQ(results_of(a), results_of(b));
  const auto frames = stored_frames(a);
  ASSERT_EQ(frames.size(), stored_frames(b).size());
  const hdf5::Session session;
  const auto open_series = [](const fs::path& run) { return hdf5::File::open(run / "sim.h5", hdf5::OtherFiles::followed); };
  const hdf5::File file_a = open_series(a), file_b = open_series(b);
  for (const auto& frame : frames) expect_same_bits(file_a, file_b, "/frames/" + frame.stem().string());
}

Json summary_of(const fs::path& directory) {
  Json summary = Json::parse(text_of(directory / "summary.json"));
  summary.erase("seconds");
  summary.erase("processor_seconds");
  summary.erase("peak_rss_mb");
  return summary;
}

/// What a killed run leaves: every step of the log but perhaps the last is linked from sim.h5 and readable.
void expect_readable(const fs::path& directory) {
  for (const auto& frame : stored_frames(directory)) EXPECT_NO_THROW(read_frame(frame)) << frame;
  const int steps = static_cast<int>(results_of(directory).size());
  const hdf5::Session session;
  const hdf5::File file = hdf5::File::open(directory / "sim.h5", hdf5::OtherFiles::followed);
  for (int step = 0; step + 1 < steps; ++step)
    EXPECT_GT(file.read_doubles(fmt::format("/frames/{:06}/fields/x", step)).rows(), 0u) << step;
}

const Arguments kImpact = {"/initial_conditions/velocity/0/value=[67, -20]",
                           "/geometry/0/transformation/translation=[0.0629, 0]",
                           "/space/remesh/split/acceptance_tolerance=1"};

Arguments operator+(Arguments a, const Arguments& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

const Case kStopped = {"stopped", "ball_wall.json", 60, R"("dt":2e-5)", {"/space/remesh/enabled=false"}};

TEST_P(ResumeTest, KilledRunGoesOnBitForBit) {
  const Case& which = GetParam();
  const fs::path whole = folder / "whole", killed = folder / "killed";
  ASSERT_EQ(start(arguments(which, whole, 30)).wait(), 0) << text_of(folder / "log");
  ASSERT_EQ(results_of(whole).size(), static_cast<std::size_t>(which.steps + 1));

  // With a period of 0 the newest frame is the state; with 0.05 s the run has to go back to an older one.
  ASSERT_EQ(stop_at(start(arguments(which, killed, 0)), killed, which.steps / 3, SIGKILL), -SIGKILL);
  expect_readable(killed);
  ASSERT_EQ(stop_at(start(arguments(which, killed, 0.05, true)), killed, 2 * which.steps / 3, SIGKILL), -SIGKILL);
  expect_readable(killed);
  const Command last = start(arguments(which, killed, 0.05, true));
  ASSERT_EQ(last.wait(), 0) << last.said();
  EXPECT_NE(last.said().find("going on after step"), std::string::npos) << last.said();
  expect_same_results(whole, killed);
  EXPECT_EQ(summary_of(whole), summary_of(killed));

  if (which.name == std::string("cubes_remeshed")) {
    const auto saved = find_saved_state(killed);
    const hdf5::Session session;
    EXPECT_TRUE(hdf5::File::open(saved->file).contains("/checkpoint/strata"));
  }

  const Command again = start(arguments(which, killed, 0.05, true));
  ASSERT_EQ(again.wait(), 0) << again.said();
  EXPECT_EQ(summary_of(whole), summary_of(killed)) << "of a finished run that was resumed";
}

TEST_F(InterruptTest, FinishesTheStepSavesAndSaysHowToGoOn) {
  const fs::path whole = folder / "whole", stopped = folder / "stopped";
  ASSERT_EQ(start(arguments(kStopped, whole, 30)).wait(), 0);
  const Command first = start(arguments(kStopped, stopped, 30));
  ASSERT_EQ(stop_at(first, stopped, 10, SIGINT), 3) << first.said();
  EXPECT_NE(first.said().find("interrupted after step"), std::string::npos) << first.said();
  EXPECT_NE(first.said().find("--resume"), std::string::npos) << first.said();
  const int steps = static_cast<int>(results_of(stopped).size());
  const Command second = start(arguments(kStopped, stopped, 30, true));
  ASSERT_EQ(second.wait(), 0) << second.said();
  EXPECT_NE(second.said().find(fmt::format("going on after step {}\n", steps - 1)), std::string::npos) << second.said();
  expect_same_results(whole, stopped);
}

TEST_F(InterruptTest, AnotherSceneIsRefusedWithWhatDiffers) {
  Case which = kStopped;
  const fs::path run = folder / "run";
  const Command first = start(arguments(which, run, 0));
  ASSERT_EQ(stop_at(first, run, 5, SIGINT), 3) << first.said();
  which.sets.push_back("/materials/nu=0.3");
  const Command second = start(arguments(which, run, 0, true));
  EXPECT_EQ(second.wait(), 2);
  EXPECT_NE(second.said().find("/materials/nu: was 0.45, is 0.3"), std::string::npos) << second.said();
  expect_readable(run);
}

/// A longer end is no other scene: a finished run goes on, to the bits of one that was longer from the start.
TEST_F(InterruptTest, ALongerEndGoesOnAfterAFinishedRun) {
  const fs::path whole = folder / "whole", run = folder / "run";
  Case which = kStopped;
  ASSERT_EQ(start(arguments(which, whole, 30)).wait(), 0);
  which.steps = 25;
  ASSERT_EQ(start(arguments(which, run, 30)).wait(), 0);
  ASSERT_EQ(results_of(run).size(), 26u);
  which.steps = kStopped.steps;
  const Command longer = start(arguments(which, run, 30, true));
  ASSERT_EQ(longer.wait(), 0) << longer.said();
  EXPECT_NE(longer.said().find("/time/time_steps: was 25, is 60"), std::string::npos) << longer.said();
  EXPECT_NE(longer.said().find("going on after step 25"), std::string::npos) << longer.said();
  expect_same_results(whole, run);
}

/// With tend and time_steps alone, another tend is another step.
TEST_F(InterruptTest, AnotherStepIsAnotherScene) {
  Case which = kStopped;
  which.time = R"("tend":0.0012)";
  const fs::path run = folder / "run";
  ASSERT_EQ(stop_at(start(arguments(which, run, 0)), run, 5, SIGINT), 3);
  which.time = R"("tend":0.0024)";
  const Command second = start(arguments(which, run, 0, true));
  EXPECT_EQ(second.wait(), 2);
  EXPECT_NE(second.said().find("/time/tend: was 0.0012, is 0.0024"), std::string::npos) << second.said();
}

/// A step that fails says what would change that, and that does change it.
TEST_F(InterruptTest, WhatAFailedStepRecommendsIsAllowedAndHelps) {
  Case which = kStopped;
  which.sets = kImpact + Arguments{"/space/remesh/enabled=false", "/solver/nonlinear/max_iterations=3"};
  const fs::path run = folder / "run";
  const Command first = start(arguments(which, run, 30));
  ASSERT_EQ(first.wait(), 3) << first.said();
  EXPECT_NE(first.said().find("--allow-changes and --set /time/step_cuts=4"), std::string::npos) << first.said();
  const int failed = static_cast<int>(results_of(run).size());
  ASSERT_LT(failed, which.steps);
  which.sets.back() = "/solver/nonlinear/max_iterations=300";
  const Command refused = start(arguments(which, run, 30, true));
  EXPECT_EQ(refused.wait(), 2);
  EXPECT_NE(refused.said().find("--allow-changes"), std::string::npos) << refused.said();
  const Command allowed = start(arguments(which, run, 30, true) + Arguments{"--allow-changes", "--solver", "eigen:llt"});
  EXPECT_EQ(allowed.wait(), 0) << allowed.said();
  EXPECT_EQ(results_of(run).size(), static_cast<std::size_t>(which.steps + 1));
}

TEST_F(InterruptTest, ResultsAreNotErasedUnasked) {
  Case which = kStopped;
  which.steps = 3;
  const fs::path run = folder / "run";
  ASSERT_EQ(start(arguments(which, run, 30)).wait(), 0);
  const auto lines = results_of(run);
  const Command again = start(arguments(which, run, 30));
  EXPECT_EQ(again.wait(), 2);
  EXPECT_NE(again.said().find("--overwrite"), std::string::npos) << again.said();
  EXPECT_NE(again.said().find("--resume"), std::string::npos) << again.said();
  EXPECT_EQ(results_of(run), lines);
  which.steps = 2;
  const Command over = start(arguments(which, run, 30) + Arguments{"--overwrite"});
  EXPECT_EQ(over.wait(), 0) << over.said();
  EXPECT_EQ(results_of(run).size(), 3u);
}

/// A step that remeshes for many seconds: patches of thousands of cells.
Case slow_remeshing() {
  return {"slow",
          "masticator.json",
          5,
          R"("dt":0.05)",
          {"/geometry/0/n_refs=2", "/space/remesh/screening=\"none\"",
           R"(/space/remesh/local_relaxation={"local_mesh_n_ring":9,"local_mesh_max_cells":2000})",
           R"j(/initial_conditions/velocity=[{"id":0,"value":["sin(7*x)",0]}])j"}};
}

TEST_F(InterruptTest, TheSecondSignalIsHeardWithinRemeshing) {
  const Case slow = slow_remeshing();
  const fs::path run = folder / "run";
  const Command command = start(arguments(slow, run, 0));
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (count_lines(run / "steps.jsonl") < 1 && std::chrono::steady_clock::now() < deadline)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  const int steps = count_lines(run / "steps.jsonl");
  std::this_thread::sleep_for(std::chrono::seconds(2));
  command.send(SIGINT);
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  EXPECT_NE(command.said().find("finishing the step; again to stop now"), std::string::npos) << command.said();
  const auto second = std::chrono::steady_clock::now();
  command.send(SIGINT);
  EXPECT_EQ(command.wait(), 3) << command.said();
  EXPECT_LT(std::chrono::steady_clock::now() - second, std::chrono::seconds(10));
  EXPECT_NE(command.said().find("which is dropped"), std::string::npos) << command.said();
  expect_readable(run);
  EXPECT_EQ(count_lines(run / "steps.jsonl"), steps) << "it was no long step";
  EXPECT_TRUE(find_saved_state(run).has_value());
}

/// Time that batch systems give after it: seconds.
TEST_F(InterruptTest, ATerminatedRunSavesTheLastWholeStep) {
  const Case slow = slow_remeshing();
  const fs::path run = folder / "run";
  const Command command = start(arguments(slow, run, 30));
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (count_lines(run / "steps.jsonl") < 1 && std::chrono::steady_clock::now() < deadline)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  std::this_thread::sleep_for(std::chrono::seconds(2));
  const int steps = count_lines(run / "steps.jsonl");
  const auto signal = std::chrono::steady_clock::now();
  command.send(SIGTERM);
  EXPECT_EQ(command.wait(), 3) << command.said();
  EXPECT_LT(std::chrono::steady_clock::now() - signal, std::chrono::seconds(10));
  EXPECT_NE(command.said().find("which is dropped"), std::string::npos) << command.said();
  EXPECT_EQ(count_lines(run / "steps.jsonl"), steps);
  const auto saved = find_saved_state(run);
  ASSERT_TRUE(saved.has_value());
  EXPECT_EQ(saved->step, steps - 1);
  EXPECT_TRUE(fs::exists(run / "summary.json"));
}

/// A step that looks at nothing for long: one factorisation by a slow solver.
TEST_F(InterruptTest, ATerminatedRunDoesNotWaitForAFactorisation) {
  const Case slow{"slow",
                  "cubes.json",
                  2,
                  R"("dt":0.01)",
                  {"/space/remesh/enabled=false", "/geometry/0/n_refs=3", "/geometry/1/n_refs=3",
                   "/solver/linear/solver=\"eigen:ldlt\""}};
  const fs::path run = folder / "run";
  const Command command = start(arguments(slow, run, 30));
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(120);
  while (count_lines(run / "steps.jsonl") < 1 && std::chrono::steady_clock::now() < deadline)
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  std::this_thread::sleep_for(std::chrono::seconds(2));
  const int steps = count_lines(run / "steps.jsonl");
  const auto signal = std::chrono::steady_clock::now();
  command.send(SIGTERM);
  EXPECT_EQ(command.wait(), 3) << command.said();
  EXPECT_LT(std::chrono::steady_clock::now() - signal, std::chrono::seconds(15));
  EXPECT_NE(command.said().find("which is dropped"), std::string::npos) << command.said();
  const auto saved = find_saved_state(run);
  ASSERT_TRUE(saved.has_value());
  EXPECT_EQ(saved->step, steps - 1);
  EXPECT_TRUE(fs::exists(run / "summary.json"));
}

/// The state before a step that fails is saved, and the reason is said, also where the frame of that state is being kept in
/// memory for the next one.
TEST_F(InterruptTest, AStepThatFailsDoesNotFailItsCheckpoint) {
  Case which = kStopped;
  which.time = R"("dt":2e-5,"quasistatic":true)";
  which.sets = {"/space/remesh/enabled=false", "/geometry/0/surface_selection=1", "/geometry/1/surface_selection=2",
                R"(/boundary_conditions/dirichlet_boundary=[{"id":1,"value":[0,0]}])",
                R"j(/boundary_conditions/obstacle_displacements=[{"id":2,"value":["-if(t-3e-5,0.2,0)",0]}])j"};
  const fs::path run = folder / "run";
  const Command command = start(arguments(which, run, 30));
  EXPECT_EQ(command.wait(), 3) << command.said();
  EXPECT_NE(command.said().find("stopped in step 2"), std::string::npos) << command.said();
  EXPECT_NE(command.said().find("held vertices cannot reach their targets"), std::string::npos) << command.said();
  EXPECT_EQ(command.said().find("HDF5"), std::string::npos) << command.said();
  const auto saved = find_saved_state(run);
  ASSERT_TRUE(saved.has_value());
  EXPECT_EQ(saved->step, 1);
}

class DamageTest : public InterruptTest {
 protected:
  /// A run of 12 steps, each of which is saved.
  fs::path make_run() const {
    const fs::path run = folder / "run";
    Case which = kStopped;
    which.steps = 12;
    EXPECT_EQ(start(arguments(which, run, 0)).wait(), 0) << text_of(folder / "log");
    return run;
  }
  Command resume(const fs::path& run) const {
    Case which = kStopped;
    which.steps = 16;
    return start(arguments(which, run, 30, true));
  }
  Command certify_run(const fs::path& run) const { return Command({}, folder / "log", 0, {"certify", run.string()}); }
  static void flip(const fs::path& file, std::size_t at, int bit) {
    std::string bytes = text_of(file);
    bytes.at(at) = static_cast<char>(bytes.at(at) ^ (1 << bit));
    std::ofstream(file, std::ios::binary) << bytes;
  }
  /// Where the values of a dataset begin.
  static std::size_t place_of(const fs::path& file, const std::string& name) {
    const hdf5::Session session;
    const std::vector<double> values = hdf5::File::open(file).read_doubles(name).values;
    const std::string bytes = text_of(file);
    const std::string_view pattern(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(double));
    const std::size_t at = bytes.rfind(pattern);
    EXPECT_NE(at, std::string::npos) << name;
    return at;
  }
};

TEST_F(DamageTest, OfTheNewestStateIsSaidAndAnOlderOneServes) {
  const fs::path whole = folder / "whole", run = make_run();
  Case which = kStopped;
  which.steps = 16;
  ASSERT_EQ(start(arguments(which, whole, 0)).wait(), 0);
  const auto frames = stored_frames(run);
  flip(frames[12], place_of(frames[12], "/checkpoint/history/v/0") + 8, 3);
  std::ofstream(frames[11], std::ios::binary) << text_of(frames[11]).substr(0, 3000);
  const Command certified = certify_run(run);
  EXPECT_EQ(certified.wait(), 2);  // of a frame that is cut off
  fs::remove(frames[11]);
  const Command again = certify_run(run);
  EXPECT_EQ(again.wait(), 4) << again.said();
  EXPECT_NE(again.said().find("frames/000012.h5: /checkpoint/history/v/0 is damaged"), std::string::npos) << again.said();
  const Command resumed = resume(run);
  ASSERT_EQ(resumed.wait(), 0) << resumed.said();
  EXPECT_NE(resumed.said().find("/checkpoint/history/v/0: found values of another digest"), std::string::npos);
  EXPECT_NE(resumed.said().find("going on after step 10"), std::string::npos) << resumed.said();
  EXPECT_EQ(results_of(run), results_of(whole));
}

TEST_F(DamageTest, OfOneBitOfAnArrayIsAlwaysSaid) {
  const fs::path run = make_run(), file = stored_frames(run).back();
  const std::string bytes = text_of(file);
  struct Array {
    std::string name;
    std::size_t begin, size;
  };
  std::vector<Array> arrays;
  {
    const hdf5::Session session;
    const hdf5::File frame = hdf5::File::open(file);
    const auto add = [&](const std::string& name, const auto& values) {
      const std::string_view pattern(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(values[0]));
      const std::size_t at = bytes.find(pattern);
      if (pattern.size() >= 16 && at != std::string::npos && at == bytes.rfind(pattern))
        arrays.push_back({name, at, pattern.size()});
    };
    for (const std::string& name : frame.digest_names()) {
      if (name[0] == '@' || !(name.starts_with("/mesh/") || name.starts_with("/checkpoint/"))) continue;
      if (frame.holds_text(name))
        add(name, frame.read_text(name));
      else if (frame.holds_integers(name))
        add(name, frame.read_integers(name).values);
      else
        add(name, frame.read_doubles(name).values);
    }
  }
  EXPECT_GT(arrays.size(), 8u);
  std::mt19937 random(1);
  for (int i = 0; i < 200; ++i) {
    const Array& array = arrays[random() % arrays.size()];
    flip(file, array.begin + random() % array.size, static_cast<int>(random() % 8));
    EXPECT_EQ(find_damage(file), std::vector{array.name});
    const auto saved = find_saved_state(run);
    ASSERT_TRUE(saved.has_value());
    if (saved->step == 12) {
      EXPECT_THROW(read_checkpoint<2>(*saved), InputError) << array.name;
    } else {
      EXPECT_EQ(saved->passed_over.size(), 1u) << array.name;
    }
    std::ofstream(file, std::ios::binary) << bytes;
  }
}

/// As a host may hand in, or a file whose digests are right.
TEST_F(DamageTest, OfInvariantsIsRefused) {
  const fs::path run = make_run();
  const auto saved = find_saved_state(run);
  ASSERT_TRUE(saved.has_value());
  auto checkpoint = read_checkpoint<2>(*saved);
  const State<2> good = checkpoint.state;
  const scene::Scene scene =
      scene::read(fmt::format("{}/examples/{}", ITR_SOURCE_DIR, kStopped.scene), {{"/space/remesh/enabled", "false"}});
  linear::Registry registry;
  Simulation<2> simulation(std::get<itr::Setup<2>>(scene.setup), registry);
  EXPECT_NO_THROW(simulation.restore(good));
  const auto message_of = [&](const std::function<void(State<2>&)>& change) {
    State<2> state = good;
    change(state);
    try {
      simulation.restore(std::move(state));
    } catch (const InputError& error) {
      return std::string(error.what());
    }
    return std::string("taken");
  };
  const auto expect = [&](const char* part, const std::function<void(State<2>&)>& change) {
    EXPECT_NE(message_of(change).find(part), std::string::npos) << message_of(change);
  };
  expect("saved velocities", [](State<2>& s) { s.history.v.clear(); });
  expect("saved velocities", [](State<2>& s) { s.history.v[0].conservativeResize(4); });
  expect("saved positions: found 2 past states", [](State<2>& s) { s.history.x.push_back(s.history.x[0]); });
  expect("saved accelerations", [](State<2>& s) { s.history.a.push_back(s.history.x[0]); });
  expect("saved velocities[3]: found nan", [](State<2>& s) { s.history.v[0][3] = NAN; });
  expect("saved positions[0]: found inf", [](State<2>& s) { s.history.x[0][0] = HUGE_VAL; });
  expect("length of saved deviation", [](State<2>& s) { s.deviation = VectorX::Zero(2); });
  expect("saved deviation[1]", [](State<2>& s) { s.deviation = s.history.x[0], s.deviation[1] = NAN; });
  expect("saved time", [](State<2>& s) { s.t = NAN; });
  expect("saved step", [](State<2>& s) { s.step = -1; });
  expect("body of a saved cell", [](State<2>& s) {
    std::vector<Vec<2>> rest;
    std::vector<std::array<int, 3>> cells;
    for (int v = 0; v < s.mesh.vertex_slots(); ++v) rest.push_back(s.mesh.rest(v));
    for (int c = 0; c < s.mesh.cell_slots(); ++c) cells.push_back(s.mesh.cell(c));
    const std::vector<int> body(cells.size(), 77);
    s.mesh = Mesh<2>(rest, cells, body);
  });
  expect("is inverted", [](State<2>& s) { std::swap(s.history.x[0][0], s.history.x[0][2]); });
  expect("surfaces intersect", [](State<2>& s) {  // through the wall
    for (int v = 0; v < s.mesh.vertex_slots(); ++v) s.history.x[0][2 * v] += 0.1;
  });
  EXPECT_EQ(message_of([](State<2>&) {}), "taken");
}

/// As after an update of itr that changed the format of saved states.
TEST_F(InterruptTest, FramesWithoutAReadableStateAreRefusedAndKept) {
  const fs::path run = folder / "run";
  const Command first = start(arguments(kStopped, run, 30));
  ASSERT_EQ(stop_at(first, run, 5, SIGINT), 3) << first.said();
  const auto frames = stored_frames(run);
  const auto lines = results_of(run);
  for (const auto& frame : frames) {
    std::string bytes = text_of(frame);
    for (std::size_t at; (at = bytes.find("checkpoint_format")) != std::string::npos;) bytes[at] = 'C';
    std::ofstream(frame, std::ios::binary) << bytes;
  }
  const Command second = start(arguments(kStopped, run, 30, true));
  EXPECT_EQ(second.wait(), 2);
  EXPECT_NE(second.said().find("no state that can be read"), std::string::npos) << second.said();
  EXPECT_EQ(stored_frames(run), frames);
  EXPECT_EQ(results_of(run), lines);
}

/// The limit on the size of a file fails a write as a full disk does; sim.xdmf meets it first.
class FullDiskTest : public InterruptTest, public ::testing::WithParamInterface<double> {};

TEST_P(FullDiskTest, StopsTheRunAndLeavesConsistentFiles) {
  const double period = GetParam();
  constexpr rlim_t kLimit = 60'000;
  const fs::path whole = folder / "whole", run = folder / "run";
  ASSERT_EQ(start(arguments(kStopped, whole, 30)).wait(), 0);
  const Command first(arguments(kStopped, run, period), folder / "log", kLimit);
  EXPECT_EQ(first.wait(), 3) << first.said();
  EXPECT_NE(first.said().find("File too large"), std::string::npos) << first.said();
  EXPECT_NE(first.said().find("space left"), std::string::npos) << first.said();
  expect_readable(run);
  for (const auto& entry : fs::recursive_directory_iterator(run)) EXPECT_NE(entry.path().extension(), ".tmp");
  const Command second = start(arguments(kStopped, run, 30, true));
  ASSERT_EQ(second.wait(), 0) << second.said();
  expect_same_results(whole, run);
}

INSTANTIATE_TEST_SUITE_P(CheckpointPeriod, FullDiskTest, ::testing::Values(0.0, 30.0));

TEST_F(InterruptTest, FolderThatCannotBeWrittenStopsTheRunBeforeItStarts) {
  std::ofstream(folder / "run") << "a file stands here";
  const Command command = start(arguments(kStopped, folder / "run", 30));
  EXPECT_EQ(command.wait(), 2);
  EXPECT_NE(command.said().find((folder / "run").string()), std::string::npos) << command.said();
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, ResumeTest,
    ::testing::Values(
        Case{"impact", "ball_wall.json", 40, R"("dt":2e-5)", kImpact},
        Case{"newmark", "ball_wall.json", 40, R"("dt":2e-5,"integrator":"ImplicitNewmark")",
             kImpact + Arguments{"/contact/friction_coefficient=0.3"}},
        Case{"bdf3", "ball_wall.json", 40, R"("dt":2e-5,"integrator":"BDF3")", kImpact},
        Case{"adaptive", "ball_wall.json", 40, R"("dt":2e-5)",
             kImpact + Arguments{"/space/remesh/enabled=false", "/contact/friction_coefficient=0.3",
                                 "/solver/contact/barrier_stiffness=\"adaptive\""}},
        Case{"adaptive_remeshed", "ball_wall.json", 40, R"("dt":2e-5)",
             kImpact + Arguments{"/contact/friction_coefficient=0.3", "/solver/contact/barrier_stiffness=\"adaptive\""}},
        Case{"cut_steps", "ball_wall.json", 40, R"("dt":2e-5,"step_cuts":6)",
             kImpact + Arguments{"/solver/nonlinear/max_iterations=8", "/space/remesh/enabled=false"}},
        Case{"damping", "ball_wall.json", 40, R"("dt":2e-5)",
             kImpact + Arguments{R"(/solver/rayleigh_damping=[{"form":"elasticity","stiffness_ratio":0.1}])"}},
        Case{
            "quadratic", "ball_wall.json", 40, R"("dt":2e-5)",
            kImpact + Arguments{"/space/remesh/enabled=false", "/space/discr_order=2", "/contact/friction_coefficient=0.3"}},
        Case{"cubes_quadratic",
             "cubes.json",
             20,
             R"("dt":0.01)",
             {R"(/space/discr_order=[{"id":1,"order":2}])"}},  // the other cube is linear
        Case{"cubes", "cubes.json", 45, R"("dt":0.01)", {}},   // 3D; they meet in step 14
        Case{"cubes_remeshed",
             "cubes.json",
             28,
             R"("dt":0.01)",
             {"/space/remesh/enabled=true", "/space/remesh/split/acceptance_tolerance=2e-4",
              "/space/remesh/swap/enabled=true", "/space/remesh/smooth/enabled=true"}},
        Case{"cubes_curved",
             "cubes.json",
             28,
             R"("dt":0.01)",
             {"/space/remesh/enabled=true", "/space/remesh/split/acceptance_tolerance=2e-4",
              "/space/remesh/curve/enabled=true", "/space/remesh/swap/enabled=true"}},
        Case{"masticator_curved",
             "masticator.json",
             24,
             R"("dt":0.05)",
             {"/space/remesh/curve/enabled=true", "/space/remesh/straighten/enabled=true",
              "/space/remesh/split/acceptance_tolerance=0.1"}},
        Case{"curved",
             "cantilever.json",
             12,
             R"("dt":0.02)",
             {"/space/remesh/curve/enabled=true", "/geometry/0/n_refs=1", "/space/remesh/swap/enabled=true",
              "/space/remesh/split/acceptance_tolerance=300"}},
        Case{"kept_order",
             "cubes.json",
             45,
             R"("dt":0.01)",
             {R"(/solver/linear/solver=["cholmod", "eigen"])", "/space/remesh/enabled=false"}},
        Case{"old_factor", "cantilever.json", 30, R"("dt":0.01)", {"/space/remesh/enabled=false", "/geometry/0/n_refs=4"}},
        Case{"held_points",
             "cantilever.json",
             12,
             R"("dt":0.05,"quasistatic":true)",
             {R"(/geometry/0/point_selection=[{"id":9,"box":[[-1,-1],[0.1,45]],"relative":false}])",
              R"(/boundary_conditions/dirichlet_boundary=[{"id":9,"value":[0,0]}])"}},
        Case{"masticator", "masticator.json", 30, R"("dt":0.05)", {}},
        Case{"quasistatic", "cantilever.json", 12, R"("dt":0.05,"quasistatic":true)", {}}),
    [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace itr::output
