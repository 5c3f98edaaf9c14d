// SPDX-License-Identifier: MIT
#include "blas_kernels.hpp"

#include <dlfcn.h>
#include <link.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>

namespace itr::linear {

namespace {

constexpr const char* kVariable = "OPENBLAS_CORETYPE";

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

FittingBlasKernels::FittingBlasKernels() {
  const char* kernels = fitting_blas_kernels();
  if (kernels && !std::getenv(kVariable) && !is_openblas_loaded()) is_set_ = setenv(kVariable, kernels, 0) == 0;
}

FittingBlasKernels::~FittingBlasKernels() {
  if (is_set_) unsetenv(kVariable);
}

std::string blas_kernels(void* handle) {
  const auto name = reinterpret_cast<char* (*)()>(dlsym(handle, "openblas_get_corename"));
  return name ? name() : "";
}

std::string advice_on_blas_kernels(const std::string& kernels) {
  const char* fitting = fitting_blas_kernels();
  if (!fitting || std::ranges::find(kOld, kernels) == std::end(kOld)) return {};
  const char* asked = std::getenv(kVariable);
  return "OpenBLAS takes its kernels for " + kernels + ", of older CPUs, " +
         (asked ? "as the environment says: unset " + std::string(kVariable)
                : "as it was loaded before: set " + std::string(kVariable) + "=" + fitting + " before the program starts");
}

}  // namespace itr::linear
