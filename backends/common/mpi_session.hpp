// SPDX-License-Identifier: MIT
// MPI for modules: initialised where nobody has, finalised at exit by whoever initialised it, never touched otherwise.
#pragma once

#include <mpi.h>

#include <cstdlib>

namespace itr::backends {

inline bool mpi_is_running() {
  int initialized = 0, finalized = 0;
  MPI_Initialized(&initialized);
  MPI_Finalized(&finalized);
  return initialized && !finalized;
}

/// False where MPI has been finalised, after which it cannot start again.
inline bool ensure_mpi() {
  if (mpi_is_running()) return true;
  int finalized = 0;
  MPI_Finalized(&finalized);
  if (finalized) return false;
  // A program that no launcher started needs no daemon beside it (Open MPI's way of saying so; others ignore it).
  if (!std::getenv("OMPI_COMM_WORLD_SIZE")) setenv("OMPI_MCA_ess_singleton_isolated", "1", 0);
  // Modules have a lock each, so two of them may call MPI at the same time.
  int provided = 0;
  if (MPI_Init_thread(nullptr, nullptr, MPI_THREAD_MULTIPLE, &provided) != MPI_SUCCESS) return false;
  std::atexit([] {
    if (mpi_is_running()) MPI_Finalize();
  });
  return true;
}

}  // namespace itr::backends
