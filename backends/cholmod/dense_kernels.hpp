// SPDX-License-Identifier: MIT
#pragma once

namespace itr::backends {

/// Matrix that a product is subtracted from: the one that is there, or zeros.
enum class From { present, zeros };

/// Dense Cholesky kernels over the BLAS of this module, on the calling thread. Matrices are stored by columns, with the
/// number of doubles between columns after their pointer; of symmetric ones the lower triangle counts, and what is above it
/// may be overwritten.
struct DenseKernels {
  /// C (m x n) = that - A (m x k) Bᵀ (n x k).
  void (*subtract_product)(From from, double* c, int ldc, const double* a, int lda, const double* b, int ldb, int m, int n,
                           int k);
  /// The first n columns of the lower triangle of C (m x m) = that - A (m x k) Aᵀ.
  void (*subtract_square)(From from, double* c, int ldc, const double* a, int lda, int m, int n, int k);
  /// X (m x k) = X L⁻ᵀ for a lower triangle L (k x k).
  void (*divide_by_transposed)(double* x, int ldx, const double* l, int ldl, int m, int k);
  /// L (k x k) becomes its Cholesky factor. Returns the number of columns before the first pivot that is not positive; k:
  /// all.
  int (*factorize_lower)(double* l, int ldl, int k);
  /// v₁ = L₁⁻¹ v₁, then v₂ -= L₂ v₁: v (r) in its first k rows and the others, L (r x k) with a lower triangle L₁ on top.
  void (*solve_forward)(const double* l, int ldl, double* v, int r, int k);
  /// v₁ = L₁⁻ᵀ (v₁ - L₂ᵀ v₂) with the same L.
  void (*solve_backward)(const double* l, int ldl, double* v, int r, int k);
  /// y (m) -= L (m x k) x.
  void (*subtract_multiple)(const double* l, int ldl, const double* x, double* y, int m, int k);
  /// y (k) -= Lᵀ x (m).
  void (*subtract_transposed)(const double* l, int ldl, const double* x, double* y, int m, int k);
  /// to[places[i]] += from[i] for i in [begin, end), places ascending.
  void (*add_scattered)(double* to, const double* from, const int* places, int begin, int end);
};

/// Kernels for this processor.
const DenseKernels& dense_kernels();

}  // namespace itr::backends
