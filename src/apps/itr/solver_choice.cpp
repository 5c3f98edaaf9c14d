// SPDX-License-Identifier: MIT
#include "commands.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "itr/core.hpp"
#include "linear/choice.hpp"
#include "scene/node.hpp"

namespace itr::cli {

namespace {

using linear::Registry;

std::string choose_name(const LinearOptions& linear, const char* place, Registry& registry) {
  try {
    return linear::choose_name(linear, registry);
  } catch (const InputError& error) {
    std::vector<std::string> names = {"auto", "eigen", "cholmod", "amesos2", "belos"};
    for (const auto& row : registry.list()) names.push_back(row.name);
    std::string expected = error.parts().expected;
    if (const std::string near = scene::nearest_name(linear.solvers.front(), names); !near.empty())
      expected = fmt::format("\"{}\" perhaps; {}", near, expected);
    throw InputError({"", place, error.parts().found, expected});
  }
}

}  // namespace

SolverChoice choose_solver(LinearOptions& linear, const RunOptions& options, Registry& registry) {
  if (!options.solver.empty()) linear.solvers = {options.solver};
  const char* place = options.solver.empty() ? "/solver/linear/solver" : "--solver";
  SolverChoice choice{choose_name(linear, place, registry), {}};
  const auto is_chosen = [&](const std::string& name) {
    return name == choice.name || Registry::canonical_name(name) == choice.name;
  };
  if (std::none_of(linear.solvers.begin(), linear.solvers.end(), is_chosen))
    choice.warnings.push_back(fmt::format("{}: there is no \"{}\" here, {} takes its place", place,
                                          fmt::join(linear.solvers, "\", \""), choice.name));
  const auto may_run = [&](const std::string& name) {
    return is_chosen(name) || choice.name == "auto" ||
           std::any_of(linear.fallback.begin(), linear.fallback.end(), [&](const std::string& other) {
             return other == "auto" || Registry::canonical_name(other) == Registry::canonical_name(name);
           });
  };
  for (const auto& [name, values] : linear.options)
    if (!may_run(name))
      choice.warnings.push_back(fmt::format("/solver/linear/options/{}: that solver is not used, {} is", name, choice.name));
  return choice;
}

}  // namespace itr::cli
