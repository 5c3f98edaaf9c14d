// SPDX-License-Identifier: MIT
#include <Trilinos_version.h>
#include <Kokkos_Core.hpp>
#include <cstdio>
#include <cstdlib>

#include "../common/blas.hpp"
#include "../common/mpi_session.hpp"
#include "trilinos.hpp"

namespace itr::backends {

std::mutex& trilinos_lock() {
  static std::mutex* const lock = new std::mutex;  // outlives every engine that is destroyed at exit
  return *lock;
}

bool trilinos_is_running() { return Kokkos::is_initialized() && mpi_is_running(); }

bool start_kokkos() {
  if (!mpi_is_running()) return false;
  if (Kokkos::is_initialized()) return true;
  Kokkos::InitArguments arguments;
  arguments.num_threads = 1;
  arguments.disable_warnings = true;
  Kokkos::initialize(arguments);
  std::atexit([] {  // before MPI's, which was registered before
    if (Kokkos::is_initialized()) Kokkos::finalize();
  });
  return true;
}

itr_engine on_mpi(itr_engine engine) {
  engine.prepare_mpi = prepare_mpi;
  return engine;
}

}  // namespace itr::backends

extern "C" __attribute__((visibility("default"))) const itr_module* itr_backend_module(void) {
  using namespace itr::backends;
  static char version[160];
  if (!version[0]) std::snprintf(version, sizeof version, "Trilinos %s, %s", TRILINOS_VERSION_STRING, pin_blas());
  static const itr_engine engines[] = {klu2_row(version), tacho_row(version),
#ifdef ITR_HAS_MUELU
                                       muelu_row(version)
#endif
  };
  static const itr_module module{ITR_BACKEND_ABI_VERSION, sizeof engines / sizeof engines[0], engines};
  return &module;
}
