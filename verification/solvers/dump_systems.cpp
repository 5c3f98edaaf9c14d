// SPDX-License-Identifier: MIT
// Steps a scene, and writes every EVERY-th linear system that it solves to a folder of its own in FOLDER:
//   itr_dump_systems SCENE FOLDER EVERY SOLVER [POINTER=VALUE]...
#include <itr/itr.hpp>

#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "dump.hpp"

namespace {

using namespace itr;

int dump(const std::string& scene, const std::string& folder, int every, const std::string& solver,
         std::vector<scene::Override> overrides) {
  const auto registry = std::make_shared<linear::Registry>();
  registry->allow_mpi_start();
  linear::BackendInfo info;
  info.name = "dumped";
  info.capabilities.iterative = info.available = true;
  registry->add(info, [&, solvers = registry.get()](const linear::SolverOptions&) {
    return linear::make_dumping_solver(solvers->create(solver), folder, every);
  });
  overrides.push_back({"/solver/linear/solver", "\"dumped\""});
  AnySimulation simulation(Model::from_scene(scene, overrides), {}, registry);
  while (!simulation.finished())
    if (const auto result = simulation.step(); !result.ok) return std::fprintf(stderr, "%s\n", result.reason.c_str()), 1;
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  const int every = argc > 4 ? std::atoi(argv[3]) : 0;
  if (every < 1) return std::fprintf(stderr, "itr_dump_systems SCENE FOLDER EVERY SOLVER [POINTER=VALUE]...\n"), 1;
  std::vector<scene::Override> overrides;
  for (int i = 5; i < argc; ++i) {
    const std::string argument = argv[i];
    const auto equals = argument.find('=');
    overrides.push_back({argument.substr(0, equals), argument.substr(equals + 1)});
  }
  try {
    return dump(argv[1], argv[2], every, argv[4], overrides);
  } catch (const InputError& error) {
    return std::fprintf(stderr, "%s\n", error.what()), 1;
  }
}
