// SPDX-License-Identifier: MIT
// MPI for modules: initialised only where the program allows it and nobody has, finalised at exit by whoever initialised it.
#pragma once

#include <mpi.h>

#include <cstdlib>
#include <vector>

#include "itr/module.h"

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
  // A program that no launcher started needs no daemon beside it, no shared memory, and no session folder, which all such
  // programs of a machine would share and delete under each other. This is how Open MPI is told; others ignore it.
  static constexpr const char* kAlone[][2] = {
      {"OMPI_MCA_ess_singleton_isolated", "1"}, {"OMPI_MCA_orte_create_session_dirs", "0"}, {"OMPI_MCA_btl", "self"}};
  std::vector<const char*> set;
  if (!std::getenv("OMPI_COMM_WORLD_SIZE"))
    for (const auto& [name, value] : kAlone)
      if (!std::getenv(name) && setenv(name, value, 0) == 0) set.push_back(name);
  // Modules have a lock each, so two of them may call MPI at the same time.
  int provided = 0;
  const int status = MPI_Init_thread(nullptr, nullptr, MPI_THREAD_MULTIPLE, &provided);
  for (const char* name : set) unsetenv(name);  // programs that this one starts are launched in their own way
  if (status != MPI_SUCCESS) return ITR_FAILED;
  std::atexit([] {
    if (mpi_is_running()) MPI_Finalize();
  });
  if (provided == MPI_THREAD_MULTIPLE) return ITR_OK;
  MPI_Finalize();
  return ITR_FAILED;
}

}  // namespace itr::backends
