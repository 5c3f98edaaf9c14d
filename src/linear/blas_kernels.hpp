// SPDX-License-Identifier: MIT
// When it is loaded, OpenBLAS chooses kernels by the CPU's model. For a CPU that is newer than the library it takes those of
// the oldest CPU: OpenBLAS 0.3.21 factorises with SSE3 where there is AVX512, at half the speed.
#pragma once

#include <string>

namespace itr::linear {

/// Kernels for the instructions that this CPU and its system have, as OPENBLAS_CORETYPE names them; null below AVX2 and on
/// other architectures, where OpenBLAS is left to choose. In double precision they are those that it takes by itself
/// for models that it knows.
const char* fitting_blas_kernels();

/// While it lives, an OpenBLAS that is loaded takes the fitting kernels. Does nothing if OPENBLAS_CORETYPE is set, or
/// OpenBLAS was loaded before. Changes the environment and restores it: no other thread may use the environment meanwhile.
class FittingBlasKernels {
 public:
  FittingBlasKernels();
  ~FittingBlasKernels();
  FittingBlasKernels(const FittingBlasKernels&) = delete;
  FittingBlasKernels& operator=(const FittingBlasKernels&) = delete;

 private:
  bool is_set_ = false;
};

/// The kernels of the OpenBLAS among the libraries of a handle of dlopen: "SkylakeX"; empty where there is none.
std::string blas_kernels(void* handle);

/// What to do about those kernels; empty where they are good.
std::string advice_on_blas_kernels(const std::string& kernels);

}  // namespace itr::linear
