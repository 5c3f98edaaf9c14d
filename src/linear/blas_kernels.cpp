// SPDX-License-Identifier: MIT
#include "blas_kernels.hpp"

#include <dlfcn.h>
#include <link.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>

namespace itr::linear {

namespace {

constexpr const char *kKernels = "OPENBLAS_CORETYPE", *kThreads = "OPENBLAS_NUM_THREADS";

/// Families below AVX2 that OpenBLAS falls back to.
constexpr const char* kOld[] = {"Generic", "Prescott", "Core2", "Penryn", "Dunnington", "Nehalem", "Sandybridge"};

bool is_openblas_loaded() {
  const auto is_it = [](dl_phdr_info* library, std::size_t, void*) {
    return library->dlpi_name && std::strstr(library->dlpi_name, "libopenblas") ? 1 : 0;
  };
  return dl_iterate_phdr(is_it, nullptr) != 0;
}

}  // namespace

const char* fitting_blas_kernels() {
#if defined(__x86_64__) && defined(__GNUC__)
  __builtin_cpu_init();
  if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma")) return nullptr;
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
    return "SkylakeX";
  return __builtin_cpu_is("amd") ? "Zen" : "Haswell";
#else
  return nullptr;
#endif
}

BlasEnvironment::BlasEnvironment() {
  if (is_openblas_loaded()) return;
  if (const char* kernels = fitting_blas_kernels(); kernels && !std::getenv(kKernels))
    sets_kernels_ = setenv(kKernels, kernels, 0) == 0;
  if (const char* asked = std::getenv(kThreads)) threads_before_ = asked;
  sets_threads_ = setenv(kThreads, "1", 1) == 0;
}

BlasEnvironment::~BlasEnvironment() {
  if (sets_kernels_) unsetenv(kKernels);
  if (!sets_threads_) return;
  if (threads_before_)
    setenv(kThreads, threads_before_->c_str(), 1);
  else
    unsetenv(kThreads);
}

std::string blas_kernels(void* handle) {
  const auto name = reinterpret_cast<char* (*)()>(dlsym(handle, "openblas_get_corename"));
  return name ? name() : "";
}

std::string advice_on_blas_kernels(const std::string& kernels) {
  const char* fitting = fitting_blas_kernels();
  if (!fitting || std::ranges::find(kOld, kernels) == std::end(kOld)) return {};
  const char* asked = std::getenv(kKernels);
  return "OpenBLAS takes its kernels for " + kernels + ", of older CPUs, " +
         (asked ? "as the environment says: unset " + std::string(kKernels)
                : "as it was loaded before: set " + std::string(kKernels) + "=" + fitting + " before the program starts");
}

}  // namespace itr::linear
