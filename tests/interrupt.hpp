// SPDX-License-Identifier: MIT
// Runs of the command that are killed or interrupted, and their results.
#pragma once

#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "core/hdf5.hpp"
#include "output/frame_file.hpp"

namespace itr::output {

namespace fs = std::filesystem;
using Json = nlohmann::json;
using Arguments = std::vector<std::string>;

inline std::string text_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

inline int count_lines(const fs::path& path) {
  const std::string text = text_of(path);
  return static_cast<int>(std::count(text.begin(), text.end(), '\n'));
}

/// Waits for a condition, on a loaded machine too; false if it does not come true within minutes.
template <class Condition>
bool wait_until(const Condition& condition) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(5);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(std::chrono::microseconds(500));
  }
  return true;
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
    setpriority(PRIO_PROCESS, 0, 10);  // a busy machine runs who watches it before it
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

inline std::ostream& operator<<(std::ostream& out, const Case& value) { return out << value.name; }

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
    EXPECT_TRUE(wait_until([&] { return count_lines(directory / "steps.jsonl") >= lines; })) << command.said();
    command.send(signal);
    return command.wait();
  }

  fs::path folder;
};

/// steps.jsonl without what depends on the machine's mood.
inline std::vector<Json> results_of(const fs::path& directory) {
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

inline void expect_same_bits(const hdf5::File& a, const hdf5::File& b, const std::string& frame) {
  for (const char* name : {"/mesh/rest", "/fields/x", "/fields/u", "/fields/v", "/fields/elastic_density", "/obstacles/x"}) {
    const auto x = a.read_doubles(frame + name).values, y = b.read_doubles(frame + name).values;
    ASSERT_EQ(x.size(), y.size()) << frame << name;
    EXPECT_TRUE(x.empty() || std::memcmp(x.data(), y.data(), x.size() * sizeof(double)) == 0) << frame << name;
  }
  for (const char* name : {"/mesh/simplices", "/mesh/body", "/mesh/surface"})
    EXPECT_EQ(a.read_integers(frame + name).values, b.read_integers(frame + name).values) << frame << name;
}

/// Through sim.h5, so that its links are tried too.
inline void expect_same_results(const fs::path& a, const fs::path& b) {
  EXPECT_EQ(results_of(a), results_of(b));
  const auto frames = stored_frames(a);
  ASSERT_EQ(frames.size(), stored_frames(b).size());
  const hdf5::Session session;
  const auto open_series = [](const fs::path& run) { return hdf5::File::open(run / "sim.h5", hdf5::OtherFiles::followed); };
  const hdf5::File file_a = open_series(a), file_b = open_series(b);
  for (const auto& frame : frames) expect_same_bits(file_a, file_b, "/frames/" + frame.stem().string());
}

inline Json summary_of(const fs::path& directory) {
  Json summary = Json::parse(text_of(directory / "summary.json"));
  summary.erase("seconds");
  summary.erase("processor_seconds");
  summary.erase("peak_rss_mb");
  return summary;
}

/// Expects that every step of a killed run's log but perhaps the last is linked from sim.h5 and readable.
inline void expect_readable(const fs::path& directory) {
  for (const auto& frame : stored_frames(directory)) EXPECT_NO_THROW(read_frame(frame)) << frame;
  const int steps = static_cast<int>(results_of(directory).size());
  const hdf5::Session session;
  const hdf5::File file = hdf5::File::open(directory / "sim.h5", hdf5::OtherFiles::followed);
  for (int step = 0; step + 1 < steps; ++step)
    EXPECT_GT(file.read_doubles(fmt::format("/frames/{:06}/fields/x", step)).rows(), 0u) << step;
}

inline const Arguments kImpact = {"/initial_conditions/velocity/0/value=[67, -20]",
                                  "/geometry/0/transformation/translation=[0.0629, 0]",
                                  "/space/remesh/split/acceptance_tolerance=1"};

inline Arguments operator+(Arguments a, const Arguments& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

inline const Case kStopped = {"stopped", "ball_wall.json", 60, R"("dt":2e-5)", {"/space/remesh/enabled=false"}};

}  // namespace itr::output
