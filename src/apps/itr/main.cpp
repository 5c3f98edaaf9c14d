// SPDX-License-Identifier: MIT
#include <fcntl.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <thread>

#include "commands.hpp"
#include "itr/core.hpp"
#include "itr/solver.hpp"
#include "itr_commit.hpp"
#include "linear/modules.hpp"
#include "output/certify.hpp"
#include "output/force_file.hpp"
#include "output/run_distance.hpp"
#include "ranks.hpp"
#include "scene/node.hpp"

namespace {

using namespace itr;

scene::Override parse_override(const std::string& text) {
  const auto equals = text.find('=');
  if (text.empty() || text[0] != '/' || equals == std::string::npos)
    throw InputError({"", "--set", "\"" + text + "\"", "/json/pointer=VALUE"});
  return {text.substr(0, equals), text.substr(equals + 1)};
}

std::string self_test(linear::Registry& registry, const std::string& name) {
  const auto solver = registry.create(name);
  const double residual = linear::self_test_residual(*solver);
  return residual >= 0 ? fmt::format("self-test residual {:.1e}", residual) : "self-test FAILED: " + solver->message();
}

int list_solvers() {
  linear::Registry registry;
  registry.allow_mpi_start();
  for (const auto& row : registry.list()) {
    if (!row.available) {
      fmt::print("{:22} absent: {}\n", row.name, row.reason);
      continue;
    }
    std::string abilities = "SPD";
    if (row.capabilities.indefinite) abilities += ", indefinite";
    if (row.capabilities.iterative) abilities += ", iterative";
    if (row.capabilities.threads) abilities += ", threads";
    if (row.capabilities.mpi) abilities += ", MPI";
    fmt::print("{:22} {}; {}; {}; {}\n", row.name, row.library_version, abilities, row.license,
               self_test(registry, row.name));
    if (!row.options.empty()) fmt::print("{:22}   options: {}\n", "", row.options);
    if (!row.advice.empty()) fmt::print("{:22}   warning: {}\n", "", row.advice);
  }
  return cli::done;
}

int print_json(const output::Certificate& certificate) {
  nlohmann::ordered_json violations = nlohmann::ordered_json::array();
  constexpr const char* kNames[] = {"file", "cells", "surfaces"};
  for (const auto& [of, text] : certificate.violations)
    violations.push_back({{"of", kNames[static_cast<int>(of)]}, {"text", text}});
  const nlohmann::ordered_json found = {{"frames", certificate.frames},
                                        {"passed", certificate.passed()},
                                        {"violations", violations},
                                        {"flight", certificate.flight},
                                        {"overhang", certificate.overhang},
                                        {"blocked_overhang", certificate.blocked_overhang},
                                        {"length", certificate.units.length()}};
  fmt::print("{}\n", found.dump(1));
  return certificate.passed() ? cli::done : cli::certificate_failed;
}

int certify(const std::string& directory, bool as_json) {
  const auto certificate = output::certify(directory);
  if (as_json) return print_json(certificate);
  for (const auto& violation : certificate.violations) fmt::print("{}\n", violation.text);
  fmt::print("{} frames, each by itself: {}\n", certificate.frames,
             certificate.passed() ? "no intersection, nothing inside of a body, no inversion" : "failed");
  if (certificate.overhang > 0)
    fmt::print(
        "curved edges, which are checked as curves, leave the chords through their nodes by at most {:.2g} {}, and by "
        "{:.2g} {} where something else is nearer than that\n",
        certificate.overhang, certificate.units.length(), certificate.blocked_overhang, certificate.units.length());
  if (certificate.overlap > 0)
    fmt::print(
        "faces that ties bond, and others that coincide at rest before they have been apart by d-hat, are no contact: they "
        "overlap by at most {:.2g} {}\n",
        certificate.overlap, certificate.units.length());
  return certificate.passed() ? cli::done : cli::certificate_failed;
}

int forces(const std::string& directory) {
  const output::ForceRows forces = output::rewrite_forces(directory);
  fmt::print("{}/{}: {} rows, {} of them added from {} frames\n", directory, output::kForceFile, forces.rows, forces.added,
             forces.frames);
  return cli::done;
}

int distance(const std::string& directory, const std::string& reference, bool last_only) {
  const auto found = output::run_distance(directory, reference, last_only ? output::Times::last : output::Times::all);
  fmt::print("{}\n", output::to_json(found).dump(1));
  return cli::done;
}

/// Adds the options of a scene that `run` and `explain` share.
void add_scene_options(CLI::App& command, cli::RunOptions& options, std::vector<std::string>& sets) {
  command.add_option("scene", options.scene, "scene file (JSON), see docs/scenes.md")->required();
  command.add_option("-o,--output", options.directory, "result folder (default: the scene's, or results/<scene>)");
  command.add_option("--solver", options.solver, "linear solver, see `itr solvers`");
  command.add_option("--threads", options.threads, "number of threads (0: all)")->check(CLI::NonNegativeNumber);
  command.add_option("--set", sets, "/json/pointer=VALUE: set a key of the merged scene (VALUE is JSON)")
      ->allow_extra_args(false);
  command.add_option_function<std::string>(
      "--defaults", [&sets](const std::string& name) { sets.push_back("/defaults=\"" + name + "\""); },
      "what keys that the scene leaves out stand for: itr (default) or polyfem, see docs/scenes.md");
  auto* overwrite = command.add_flag("--overwrite", options.overwrite, "replace the results that the folder has");
  auto* resume = command.add_flag("--resume", options.resume,
                                  "go on from the newest state that the folder has, or from the beginning; tend may change");
  command
      .add_flag("--allow-changes", options.allow_changes,
                "with --resume: another solver, other tolerances, /time/step_cuts, /space/remesh too")
      ->needs(resume);
  resume->excludes(overwrite);
}

/// A word that is no command gets the one that was meant.
void check_command(const CLI::App& app, int argc, char** argv) {
  if (argc < 2 || argv[1][0] == '-') return;
  std::vector<std::string> names;
  for (const auto* command : app.get_subcommands([](const CLI::App*) { return true; })) names.push_back(command->get_name());
  if (std::find(names.begin(), names.end(), argv[1]) != names.end()) return;
  const std::string near = scene::nearest_name(argv[1], names);
  throw InputError({"", "itr", fmt::format("no such command: {}", argv[1]),
                    fmt::format("{}one of {}", near.empty() ? "" : near + " perhaps; ", fmt::join(names, ", "))});
}

/// Becomes the Python program of `itr study`, `itr sweep` or `itr fit` (src/apps), which gets these arguments, the last of
/// them null.
[[noreturn]] void become_python(const std::string& name, char** arguments) {
  namespace fs = std::filesystem;
  const fs::path program = fs::canonical("/proc/self/exe");
  std::string folder = (program.parent_path() / ITR_PROGRAMS_FOLDER / name).lexically_normal().string();
  if (!fs::exists(folder))
    throw InputError(
        {folder, "", "no such folder", fmt::format("the Python program of `itr {}`, installed beside the command", name)});
  std::string self = program.string(), modules;
  if (name == "study") {  // its runs find the program and its modules even if files are replaced while it runs
    if (const int file = open("/proc/self/exe", O_RDONLY); file >= 0) self = fmt::format("/proc/{}/fd/{}", getpid(), file);
    for (const fs::path& one : linear::module_folders()) modules += (modules.empty() ? "" : ":") + one.string();
    setenv("ITR_BACKEND_PATH", modules.c_str(), 1);
  }

  const char* asked = std::getenv("ITR_PYTHON");
  std::string python = asked ? asked : fs::exists("/usr/bin/python3") ? "/usr/bin/python3" : "python3", option = "-B";
  std::vector<char*> words = {python.data(), option.data(), folder.data(), self.data()};
  for (; *arguments; ++arguments) words.push_back(*arguments);
  words.push_back(nullptr);
  execvp(python.c_str(), words.data());
  throw InputError({"", name, "no program " + python,
                    fmt::format("Python: apt install python3 python3-matplotlib{}", name == "fit" ? " python3-scipy" : "")});
}

void check_single_rank() {
  if (cli::this_launch().ranks > 1) throw InputError({"", "itr", "several MPI ranks", "one rank: only `itr run` uses more"});
}

int dispatch(int argc, char** argv) {
  CLI::App app("In-Timestep Remeshing for contacting elastodynamics");
  app.require_subcommand(1);
  const std::string commit = ITR_COMMIT;
  app.set_version_flag("--version", ITR_VERSION + (commit.empty() ? "" : " (" + commit + ")"));
  cli::RunOptions options;
  std::vector<std::string> sets;
  std::string directory;
  bool as_page = false, as_json = false;
  auto* run = app.add_subcommand("run", "simulate a scene");
  add_scene_options(*run, options, sets);
  run->add_flag("--profile", options.profile, "write where the time of each step goes into profile.jsonl");
  run->add_flag("--report", options.report, "at the end, write report.html into the folder: see `itr report`");
  auto* explain = app.add_subcommand("explain", "say what would be modelled and why; runs nothing; takes options of run");
  add_scene_options(*explain, options, sets);
  explain->add_flag("--json", as_json, "what is known of the scene before it runs, as one JSON object, in its units");
  auto* schema = app.add_subcommand("schema", "JSON Schema of scenes");
  schema->add_flag("--markdown", as_page, "the same as a page to read: docs/scenes.md");
  auto* solvers = app.add_subcommand("solvers", "list linear solvers, present and absent");
  auto* check = app.add_subcommand("certify", "re-check every stored frame with exact predicates");
  check->add_option("directory", directory, "result folder")->required();
  check->add_flag("--json", as_json, "as one JSON object");
  auto* report_command =
      app.add_subcommand("report", "one HTML file that shows a run, or a study: opens in a browser, from the disk");
  std::string report_file;
  report::ReportOptions report_options;
  report_command->add_option("directory", directory, "folder of a run that is finished or not, or of a study")->required();
  report_command->add_option("-o,--output", report_file, "the file (default: report.html in the folder)");
  report_command->add_flag("--certify", report_options.certify,
                           "of a run: re-checks all its stored frames, as `itr certify`");
  report_command->add_option("--every", report_options.every, "takes each so many-th of the stored frames")
      ->check(CLI::PositiveNumber);
  report_command
      ->add_option("--max-mb", report_options.max_mb,
                   "of the file (default: 30): takes every 2nd, 4th, ... frame if it were larger")
      ->check(CLI::PositiveNumber);
  auto* curves = app.add_subcommand("forces", "completes forces.csv from the frames of a run with /output/forces");
  curves->add_option("directory", directory, "result folder")->required();
  std::string reference;
  bool last_only = false;
  auto* apart = app.add_subcommand("distance", "errors of a run against another of the same bodies, as one JSON object");
  apart->add_option("directory", directory, "result folder")->required();
  apart->add_option("reference", reference, "result folder of the run to compare with")->required();
  apart->add_flag("--last", last_only, "at the last time that both have stored alone (default: at all of them)");
  app.add_subcommand("study", "speed against error: runs a scene on many meshes and says which to take");
  app.add_subcommand("sweep",
                     "runs of a scene with other values, for GNU parallel or a job array, and their results in a table");
  app.add_subcommand("fit", "coefficients of a law of rubber from several tests at once");
  const std::string asked = argc > 1 ? argv[1] : "";
  if (asked == "respond") return cli::respond();  // what `itr fit` asks
  check_command(app, argc, argv);
  if (asked == "study" || asked == "sweep" || asked == "fit") {
    check_single_rank();
    become_python(asked, argv + 2);
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& success) {
    return app.exit(success);
  } catch (const CLI::ParseError& error) {
    app.exit(error);
    return cli::bad_input;
  }
  if (!*run) check_single_rank();
  if (*solvers) return list_solvers();
  if (*check) return certify(directory, as_json);
  if (*report_command) return cli::report(directory, report_file, report_options);
  if (*curves) return forces(directory);
  if (*apart) return distance(directory, reference, last_only);
  if (*schema) {
    fmt::print("{}{}", as_page ? scene::reference_page() : scene::json_schema(), as_page ? "" : "\n");
    return cli::done;
  }
  for (const auto& text : sets) options.overrides.push_back(parse_override(text));
  try {
    if (*explain) return as_json ? cli::print_facts(options) : cli::explain(options);
    return cli::run(options);
  } catch (const InputError& error) {  // what the library finds wrong with a setup is wrong with its scene
    if (!error.parts().file.empty()) throw;
    InputError::Parts parts = error.parts();
    parts.file = options.scene.string();
    throw InputError(parts);
  }
}

}  // namespace

int main(int argc, char** argv) {
  spdlog::set_default_logger(spdlog::stderr_color_mt("itr"));
  spdlog::set_pattern("%v");
  // All ranks read the scene and see the same mistakes; one of them says so.
  const bool speaks = itr::cli::this_launch().rank == 0;
  if (!speaks) spdlog::set_level(spdlog::level::off);
  std::signal(SIGXFSZ, SIG_IGN);  // a limit on file sizes is an error of the write, as a full disk is
  try {
    return dispatch(argc, argv);
  } catch (const itr::InputError& error) {
    // A launcher ends all ranks when one has failed: the others wait until rank 0 has said why. Who is still there then has
    // seen what rank 0 has not: a file that is not on this machine.
    if (!speaks) std::this_thread::sleep_for(std::chrono::seconds(5));
    fmt::print(stderr, "itr: {}{}\n", speaks ? "" : fmt::format("rank {}: ", itr::cli::this_launch().rank), error.what());
    return itr::cli::bad_input;
  } catch (const std::exception& error) {
    fmt::print(stderr, "itr: internal error: {}\n", error.what());
    return itr::cli::simulation_stopped;
  }
}
