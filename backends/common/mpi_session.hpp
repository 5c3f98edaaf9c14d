// SPDX-License-Identifier: MIT
// MPI for modules: initialised only where the program allows it and nobody has, finalised at exit by whoever initialised it.
#pragma once

#include <mpi.h>

#include <cstdlib>

#include "itr/linear/abi.h"

namespace itr::backends {

inline bool mpi_is_running() {
  int initialized = 0, finalized = 0;
  MPI_Initialized(&initialized);
  MPI_Finalized(&finalized);
  return initialized && !finalized;
}

/// itr_engine::prepare_mpi. MPI that has been finalised cannot start again.
inline int32_t prepare_mpi(int32_t may_start) {
  if (mpi_is_running()) return ITR_OK;
  int finalized = 0;
  MPI_Finalized(&finalized);
  if (finalized || !may_start) return ITR_FAILED;
  // A program that no launcher started needs no daemon beside it (Open MPI's way of saying so; others ignore it).
  if (!std::getenv("OMPI_COMM_WORLD_SIZE")) setenv("OMPI_MCA_ess_singleton_isolated", "1", 0);
  // Modules have a lock each, so two of them may call MPI at the same time.
  int provided = 0;
  if (MPI_Init_thread(nullptr, nullptr, MPI_THREAD_MULTIPLE, &provided) != MPI_SUCCESS) return ITR_FAILED;
  std::atexit([] {
    if (mpi_is_running()) MPI_Finalize();
  });
  return ITR_OK;
}

}  // namespace itr::backends
