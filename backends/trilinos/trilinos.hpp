// SPDX-License-Identifier: MIT
// Common part of the engines over Kokkos: its start, its one lock, its way to say that memory is out. And the module's rows.
#pragma once

#include <cstring>
#include <exception>
#include <memory>
#include <mutex>
#include <new>
#include <stdexcept>
#include <string_view>

#include "itr/module.h"

namespace itr::backends {

/// Kokkos is not re-entrant: every call into it, destructors included, happens under this, and what else is shared.
std::mutex& trilinos_lock();

/// Starts Kokkos where nobody has, finalised at exit by whoever started it. False where MPI does not run.
bool start_kokkos();
/// False after Kokkos or MPI was finalised: what is left of an engine must not be touched then.
bool trilinos_is_running();

/// Kokkos makes a std::runtime_error of std::bad_alloc.
inline bool is_out_of_memory(const std::exception& error) {
  return dynamic_cast<const std::bad_alloc*>(&error) || std::strstr(error.what(), "failed to allocate memory");
}

/// An engine all of whose calls are made with Kokkos running and under its lock. Its default constructor makes no object of
/// Kokkos.
template <typename Engine>
class OnKokkos {
 public:
  OnKokkos() = default;
  ~OnKokkos() {
    const std::scoped_lock guard(trilinos_lock());
    // After Kokkos has taken its memory back, what is left must not be destroyed.
    if (!trilinos_is_running()) static_cast<void>(engine_.release());
    engine_.reset();
  }
  OnKokkos(const OnKokkos&) = delete;
  OnKokkos& operator=(const OnKokkos&) = delete;

  int set_option(std::string_view key, std::string_view value) { return engine_->set_option(key, value); }
  int analyze(const itr_pattern& pattern, const itr_hints& hints) {
    return guarded(start_kokkos, [&] { return engine_->analyze(pattern, hints); });
  }
  int factorize(const double* values, size_t count) {
    return guarded(trilinos_is_running, [&] { return engine_->factorize(values, count); });
  }
  int solve(const double* rhs, double* solution, int columns) {
    return guarded(trilinos_is_running, [&] { return engine_->solve(rhs, solution, columns); });
  }
  itr_statistics statistics() const { return engine_->statistics(); }
  const char* message() const { return engine_->message(); }

 private:
  template <typename F>
  static int guarded(bool (*ready)(), F&& f) {
    const std::scoped_lock guard(trilinos_lock());
    if (!ready()) throw std::runtime_error("MPI does not run");
    try {
      return f();
    } catch (const std::exception& error) {
      if (is_out_of_memory(error)) throw std::bad_alloc();
      throw;
    }
  }
  std::unique_ptr<Engine> engine_ = std::make_unique<Engine>();
};

/// A row of an engine that needs MPI, if only on its own rank: Debian's Trilinos is built on it.
itr_engine on_mpi(itr_engine engine);
template <typename Engine>
itr_engine kokkos_row(const char* name, const char* version, const char* license, uint32_t capabilities,
                      const char* options) {
  return on_mpi(linear::ModuleAdapter<OnKokkos<Engine>>::row(name, version, license, capabilities, options));
}

itr_engine klu2_row(const char* version);
itr_engine tacho_row(const char* version);
itr_engine muelu_row(const char* version);

}  // namespace itr::backends
