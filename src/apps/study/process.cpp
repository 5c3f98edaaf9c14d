// SPDX-License-Identifier: MIT
#include "process.hpp"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <thread>

#include "core/timer.hpp"
#include "itr/core/error.hpp"

namespace itr::cli::study {

namespace {

constexpr double kGrace = 20;  ///< to finish a step and to save it [s]
constexpr std::chrono::milliseconds kPatience(5);

}  // namespace

ProcessEnd run_this_program(const std::vector<std::string>& arguments, const std::filesystem::path& log, double time_limit,
                            const std::function<bool()>& is_stopped) {
  const std::string program = "/proc/self/exe";  // the same one, even where its file has been replaced meanwhile
  std::vector<char*> words = {const_cast<char*>(program.c_str())};
  for (const auto& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
  words.push_back(nullptr);
  const int output = open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (output < 0) throw InputError({log.string(), "", std::strerror(errno), "a file that can be written"});
  const pid_t parent = getpid(), child = fork();
  if (child == 0) {
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) _exit(1);  // it ended before that took hold
    dup2(output, STDOUT_FILENO);
    dup2(output, STDERR_FILENO);
    execv(program.c_str(), words.data());
    _exit(127);
  }
  close(output);
  if (child < 0) throw InputError({program, "", std::strerror(errno), "a new process"});

  ProcessEnd end;
  int status = 0;
  const double start = seconds_now();
  for (pid_t done = 0; done != child; done = waitpid(child, &status, WNOHANG)) {
    std::this_thread::sleep_for(kPatience);
    const double elapsed = seconds_now() - start;
    const bool is_late = time_limit > 0 && elapsed > time_limit, was_told = end.timed_out || end.stopped;
    end.timed_out |= is_late;
    end.stopped |= is_stopped();
    if (!was_told && (end.timed_out || end.stopped)) kill(child, SIGTERM);
    if (time_limit > 0 && elapsed > time_limit + kGrace) kill(child, SIGKILL);
  }
  end.status = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  end.signal = WIFSIGNALED(status) ? WTERMSIG(status) : 0;
  return end;
}

}  // namespace itr::cli::study
