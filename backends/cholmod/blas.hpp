// SPDX-License-Identifier: MIT
#pragma once

namespace itr::backends {

/// dgemm of this module's libraries, and the pieces that a product is cut into for it.
struct Blas {
  using Gemm = void(const char*, const char*, const int*, const int*, const int*, const double*, const double*, const int*,
                    const double*, const int*, const double*, double*, const int*);
  Gemm* gemm;
  int rows, columns, depth;
};

const Blas& blas();

}  // namespace itr::backends
