// SPDX-License-Identifier: MIT
#include "dense_kernels.hpp"

#include <stdexcept>
#include <string_view>

#include "../common/loaded.hpp"
#include "dense_kernels_body.hpp"

namespace itr::backends {

#ifdef ITR_HAS_AVX512_KERNELS
const DenseKernels& avx512_kernels();
#endif

const DenseKernels& dense_kernels() {
#ifdef ITR_HAS_AVX512_KERNELS
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
    return avx512_kernels();
#endif
  return kKernels;
}

const Blas& blas() {
  static const Blas found = [] {
    auto* const gemm = find_loaded<Blas::Gemm>("dgemm_");
    if (!gemm) throw std::runtime_error("no dgemm in the libraries of CHOLMOD");
    const auto kernels = find_loaded<char*()>("openblas_get_corename");
    // With these kernels OpenBLAS multiplies matrices without copies up to a million products.
    for (const std::string_view name : {"SkylakeX", "Cooperlake", "SapphireRapids"})
      if (kernels && kernels() == name) return Blas{gemm, 192, 32, 128};
    return Blas{gemm, 512, 96, 256};
  }();
  return found;
}

}  // namespace itr::backends
