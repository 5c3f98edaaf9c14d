// SPDX-License-Identifier: MIT
// Dense kernels for processors with AVX-512, which this file alone is compiled for.
#include "dense_kernels_body.hpp"

namespace itr::backends {

const DenseKernels& avx512_kernels();
const DenseKernels& avx512_kernels() { return kKernels; }

}  // namespace itr::backends
