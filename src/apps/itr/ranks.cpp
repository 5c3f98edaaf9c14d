// SPDX-License-Identifier: MIT
#include "ranks.hpp"

#include <csignal>
#include <cstdlib>
#include <utility>

#include "commands.hpp"

namespace itr::cli {

Launch this_launch() {
  constexpr std::pair<const char*, const char*> kVariables[] = {
      {"OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"},  // Open MPI
      {"PMI_RANK", "PMI_SIZE"}};                         // MPICH, Intel MPI, Slurm's PMI
  for (const auto& [rank_name, size_name] : kVariables) {
    const char *rank = std::getenv(rank_name), *size = std::getenv(size_name);
    if (rank && size) return {std::atoi(rank), std::atoi(size)};
  }
  return {};
}

RankSession::RankSession(linear::Registry& registry, std::string solver) : registry_(registry) {
  if (this_launch().ranks == 1) return;
  registry_.connect(solver);
  solver_ = std::move(solver);
}

RankSession::~RankSession() {
  if (!solver_.empty()) registry_.disconnect(solver_);
}

int serve(linear::Registry& registry, const std::string& solver) {
  // A launcher that is interrupted tells all ranks; rank 0 still needs us to end its step.
  std::signal(SIGINT, SIG_IGN);
  std::signal(SIGTERM, SIG_IGN);
  registry.serve(solver);
  return done;
}

}  // namespace itr::cli
