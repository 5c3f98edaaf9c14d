// SPDX-License-Identifier: MIT
#include "python_value.hpp"

#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <memory>
#include <mutex>

extern char** environ;

namespace itr::scene {

namespace {

/// Answers lines of a function's name and hexadecimal numbers by lines of one such number, or of "!" and an error. What the
/// file prints goes to standard error.
constexpr const char* kAnswer = R"(
import importlib.util, inspect, os, sys
path, answers, sys.stdout = sys.argv[1], sys.stdout, sys.stderr
sys.path.insert(0, os.path.dirname(path))
module, failure = None, None
try:
    spec = importlib.util.spec_from_file_location("scene_values", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
except BaseException as error:
    failure = error
for line in sys.stdin:
    name, *numbers = line.split()
    try:
        if failure: raise failure
        function = getattr(module, name)
        asked = len(inspect.signature(function).parameters)
        answer = float(function(*([float.fromhex(n) for n in numbers] + [0])[:max(asked, 4)])).hex()
    except BaseException as error:
        answer = "! " + type(error).__name__ + ": " + " ".join(str(error).split())
    print(answer, file=answers, flush=True)
)";

constexpr const char* kEnded = "! python3 has ended";

/// Python with one file, until the last function of it is gone.
class Interpreter {
 public:
  explicit Interpreter(const std::string& path) {
    std::array<int, 2> ends;
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) return;
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDIN_FILENO);
    posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
    const std::array<const char*, 5> arguments{"python3", "-c", kAnswer, path.c_str(), nullptr};
    if (posix_spawnp(&child_, "python3", &actions, nullptr, const_cast<char* const*>(arguments.data()), environ) != 0)
      child_ = -1;
    posix_spawn_file_actions_destroy(&actions);
    close(ends[1]);
    socket_ = ends[0];
  }
  Interpreter(const Interpreter&) = delete;
  Interpreter& operator=(const Interpreter&) = delete;
  ~Interpreter() {
    if (socket_ >= 0) close(socket_);
    if (child_ > 0) waitpid(child_, nullptr, 0);
  }
  bool has_begun() const { return child_ > 0; }

  /// A number, or "!" and an error.
  std::string ask(const std::string& name, const std::array<double, 4>& at) {
    const std::lock_guard lock(mutex_);
    std::array<char, 160> numbers;
    std::snprintf(numbers.data(), numbers.size(), " %a %a %a %a\n", at[0], at[1], at[2], at[3]);
    const std::string question = name + numbers.data();
    std::size_t sent = 0;
    while (sent < question.size()) {  // a process that is no more sends no signal
      const ssize_t n = send(socket_, question.data() + sent, question.size() - sent, MSG_NOSIGNAL);
      if (n < 0 && errno != EINTR) return kEnded;
      sent += static_cast<std::size_t>(std::max<ssize_t>(n, 0));
    }
    std::string answer;
    while (!answer.ends_with('\n')) {
      std::array<char, 256> part;
      const ssize_t n = recv(socket_, part.data(), part.size(), 0);
      if (n == 0 || (n < 0 && errno != EINTR)) return kEnded;
      answer.append(part.data(), static_cast<std::size_t>(std::max<ssize_t>(n, 0)));
    }
    answer.pop_back();
    return answer;
  }

 private:
  pid_t child_ = -1;
  int socket_ = -1;
  std::mutex mutex_;
};

}  // namespace

/// One by file, which all values of a scene that name the file share.
class Interpreters {
 public:
  std::shared_ptr<Interpreter> of(const std::string& path) {
    std::shared_ptr<Interpreter>& found = by_path_[path];
    if (!found) found = std::make_shared<Interpreter>(path);
    return found;
  }

 private:
  std::map<std::string, std::shared_ptr<Interpreter>> by_path_;
};
std::shared_ptr<Interpreters> make_interpreters() { return std::make_shared<Interpreters>(); }

bool is_python_value(const Json& json) { return json.is_object() && json.contains("file_name"); }

std::function<double(double x, double y, double z, double t)> read_python_value(const Node& node) {
  const Node file = node["file_name"];
  const std::string path = node.document().resolve(file.string("")).string();
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored))
    file.fail(abbreviate(file.json()) + ", but there is no file '" + path + "'", "a Python file");
  const std::string name = node["function_name"].string("");
  if (name.empty() ||
      name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_") != std::string::npos)
    node["function_name"].fail("the name of a function");
  const std::shared_ptr<Interpreter> interpreter = node.document().interpreters->of(path);
  if (!interpreter->has_begun()) node.fail(abbreviate(node.json()) + ", but python3 does not run", "python3 on the path");
  const InputError::Parts parts{node.document().file.string(), node.pointer(), abbreviate(node.json()), "a number"};
  return [=](double x, double y, double z, double t) {
    const std::string answer = interpreter->ask(name, {x, y, z, t});
    if (!answer.starts_with('!')) return std::strtod(answer.c_str(), nullptr);
    InputError::Parts wrong = parts;
    wrong.found += ", which ends with " + answer.substr(2);
    throw InputError(wrong);
  };
}

}  // namespace itr::scene
