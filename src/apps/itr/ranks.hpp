// SPDX-License-Identifier: MIT
// `mpirun -n N itr run ...`: rank 0 simulates, the others serve its linear solver.
#pragma once

#include <string>

#include "itr/solver.hpp"

namespace itr::cli {

/// Place of this process among the launcher's, from its environment: known before any MPI library is loaded.
struct Launch {
  int rank = 0, ranks = 1;
};
Launch this_launch();

/// On rank 0: all ranks of the launch stand behind `solver` while this lives. Throws InputError if it does not use MPI.
class RankSession {
 public:
  RankSession(linear::Registry& registry, std::string solver);
  ~RankSession();
  RankSession(const RankSession&) = delete;
  RankSession& operator=(const RankSession&) = delete;

 private:
  linear::Registry& registry_;
  std::string solver_;  ///< empty: one rank
};

/// On the other ranks: until rank 0 ends. Returns the exit status; throws as RankSession does.
int serve(linear::Registry& registry, const std::string& solver);

}  // namespace itr::cli
