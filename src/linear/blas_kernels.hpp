// SPDX-License-Identifier: MIT
// When it is loaded, OpenBLAS chooses kernels by the CPU's model. For a CPU that is newer than the library it takes those of
// the oldest CPU: OpenBLAS 0.3.21 factorises with SSE3 where there is AVX512, at half the speed.
#pragma once

#include <optional>
#include <string>

namespace itr::linear {

/// Kernels for the instructions that this CPU and its system have, as OPENBLAS_CORETYPE names them; null below AVX2 and on
/// other architectures, where OpenBLAS is left to choose. In double precision they are those that it takes by itself
/// for models that it knows.
const char* fitting_blas_kernels();

/// While it lives, an OpenBLAS that is loaded takes the fitting kernels, unless OPENBLAS_CORETYPE is set, and starts no
/// threads: modules pin it to one, and those that it starts wait in busy loops for some 20 ms. Does nothing if OpenBLAS was
/// loaded before. Changes the environment and restores it: no other thread may use the environment meanwhile.
class BlasEnvironment {
 public:
  BlasEnvironment();
  ~BlasEnvironment();
  BlasEnvironment(const BlasEnvironment&) = delete;
  BlasEnvironment& operator=(const BlasEnvironment&) = delete;

 private:
  bool sets_kernels_ = false, sets_threads_ = false;
  std::optional<std::string> threads_before_;
};

/// The kernels of the OpenBLAS among the libraries of a handle of dlopen: "SkylakeX"; empty where there is none.
std::string blas_kernels(void* handle);

/// Advice on slow kernels; empty where they are good.
std::string advice_on_blas_kernels(const std::string& kernels);

}  // namespace itr::linear
