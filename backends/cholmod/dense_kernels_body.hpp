// SPDX-License-Identifier: MIT
// Dense kernels, in files that are compiled for different processors: all is local to the file that includes this.
//
// OpenBLAS multiplies small matrices at 100 GFlop/s of a core where it updates symmetric ones at 40 and solves with
// triangles at 20 (Zen 5 with AVX-512). So all work but that of 8 columns is given to dgemm.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstring>
#include <type_traits>

#include "dense_kernels.hpp"

namespace itr::backends {

/// dgemm of this module's libraries, and the pieces that a product is cut into for it.
struct Blas {
  using Gemm = void(const char*, const char*, const int*, const int*, const int*, const double*, const double*, const int*,
                    const double*, const int*, const double*, double*, const int*);
  Gemm* gemm;
  int rows, columns, depth;
};

const Blas& blas();

namespace {

/// Rows that a register takes.
#if defined(__AVX512F__)
constexpr int kLanes = 8;
#elif defined(__AVX__)
constexpr int kLanes = 4;
#else
constexpr int kLanes = 2;
#endif
using Lanes = double __attribute__((vector_size(kLanes * sizeof(double))));
constexpr int kBase = 8;  ///< columns that register kernels take

/// Calls use(row, copy) for all rows by kLanes, where copy(to, from) copies those of them that are there.
template <typename Use>
void for_lanes(int m, const Use& use) {
  int row = 0;
  for (; row + kLanes <= m; row += kLanes)
    use(row, [](void* to, const void* from) { std::memcpy(to, from, sizeof(Lanes)); });
  if (row < m) use(row, [bytes = (m - row) * sizeof(double)](void* to, const void* from) { std::memcpy(to, from, bytes); });
}

double sum(const Lanes& lanes) {
  double total = 0;
  for (int i = 0; i < kLanes; ++i) total += lanes[i];
  return total;
}

/// divide_by_transposed for K columns.
template <int K>
void divide_base(double* x, int ldx, const double* l, int ldl, int m) {
  double factor[K][K], inverse[K];
  for (int j = 0; j < K; ++j) {
    for (int p = 0; p < j; ++p) factor[j][p] = l[j + static_cast<long>(p) * ldl];
    inverse[j] = 1 / l[j + static_cast<long>(j) * ldl];
  }
  for_lanes(m, [&](int row, const auto& copy) {
    Lanes v[K]{};
    for (int j = 0; j < K; ++j) {
      copy(&v[j], x + row + static_cast<long>(j) * ldx);
      for (int p = 0; p < j; ++p) v[j] -= v[p] * factor[j][p];
      v[j] *= inverse[j];
    }
    for (int j = 0; j < K; ++j) copy(x + row + static_cast<long>(j) * ldx, &v[j]);
  });
}

/// factorize_lower for at most kBase columns.
int factorize_base(double* l, int ldl, int k) {
  for (int j = 0; j < k; ++j) {
    double* const column = l + static_cast<long>(j) * ldl;
    if (!(column[j] > 0)) return j;
    column[j] = std::sqrt(column[j]);
    const double inverse = 1 / column[j];
    for (int i = j + 1; i < k; ++i) column[i] *= inverse;
    for (int p = j + 1; p < k; ++p)
      for (int i = p; i < k; ++i) l[i + static_cast<long>(p) * ldl] -= column[i] * column[p];
  }
  return k;
}

/// Columns of the first half: whole register kernels.
int half(int k) { return (k / 2 + kBase - 1) / kBase * kBase; }

constexpr int kGroup = 4;  ///< columns of a solve that one sweep over rows takes

/// y (m) -= L (m x K) x.
template <int K>
void subtract_columns(const double* l, int ldl, const double* x, double* y, int m) {
  for_lanes(m, [&](int row, const auto& copy) {
    Lanes v{};
    copy(&v, y + row);
    for (int c = 0; c < K; ++c) {
      Lanes column{};
      copy(&column, l + row + static_cast<long>(c) * ldl);
      v -= column * x[c];
    }
    copy(y + row, &v);
  });
}

/// y (K) -= Lᵀ x (m).
template <int K>
void subtract_dots(const double* l, int ldl, const double* x, double* y, int m) {
  Lanes total[K]{};
  for_lanes(m, [&](int row, const auto& copy) {
    Lanes v{};
    copy(&v, x + row);
    for (int c = 0; c < K; ++c) {
      Lanes column{};
      copy(&column, l + row + static_cast<long>(c) * ldl);
      total[c] += column * v;
    }
  });
  for (int c = 0; c < K; ++c) y[c] -= sum(total[c]);
}

/// Calls use(std::integral_constant of count) for 1 to Most.
template <int Most, typename Use>
void with_constant(int count, const Use& use) {
  if constexpr (Most > 1)
    if (count < Most) return with_constant<Most - 1>(count, use);
  use(std::integral_constant<int, Most>{});
}

void subtract_product(From from, double* c, int ldc, const double* a, int lda, const double* b, int ldb, int m, int n,
                      int k) {
  constexpr double kZero = 0, kOne = 1, kMinusOne = -1;
  const Blas& by = blas();
  for (int column = 0; column < n; column += by.columns)
    for (int row = 0; row < m; row += by.rows)
      for (int depth = 0; depth < k; depth += by.depth) {
        const int rows = std::min(by.rows, m - row), columns = std::min(by.columns, n - column);
        const int terms = std::min(by.depth, k - depth);
        by.gemm("N", "T", &rows, &columns, &terms, &kMinusOne, a + row + static_cast<long>(depth) * lda, &lda,
                b + column + static_cast<long>(depth) * ldb, &ldb, from == From::zeros && depth == 0 ? &kZero : &kOne,
                c + row + static_cast<long>(column) * ldc, &ldc);
      }
}

void subtract_square(From from, double* c, int ldc, const double* a, int lda, int m, int n, int k) {
  const int width = blas().columns;
  for (int column = 0; column < n; column += width)
    subtract_product(from, c + column + static_cast<long>(column) * ldc, ldc, a + column, lda, a + column, lda, m - column,
                     std::min(width, n - column), k);
}

void divide_by_transposed(double* x, int ldx, const double* l, int ldl, int m, int k) {
  if (m == 0 || k == 0) return;
  if (k <= kBase)
    return with_constant<kBase>(k, [&](auto constant) { divide_base<decltype(constant)::value>(x, ldx, l, ldl, m); });
  const int first = half(k);
  divide_by_transposed(x, ldx, l, ldl, m, first);
  double* const rest = x + static_cast<long>(first) * ldx;
  subtract_product(From::present, rest, ldx, x, ldx, l + first, ldl, m, k - first, first);
  divide_by_transposed(rest, ldx, l + first + static_cast<long>(first) * ldl, ldl, m, k - first);
}

int factorize_lower(double* l, int ldl, int k) {
  if (k <= kBase) return factorize_base(l, ldl, k);
  const int first = half(k);
  if (const int done = factorize_lower(l, ldl, first); done < first) return done;
  double* const below = l + first;
  double* const rest = below + static_cast<long>(first) * ldl;
  divide_by_transposed(below, ldl, l, ldl, k - first, first);
  subtract_square(From::present, rest, ldl, below, ldl, k - first, k - first, first);
  return first + factorize_lower(rest, ldl, k - first);
}

void subtract_multiple(const double* l, int ldl, const double* x, double* y, int m, int k) {
  for (int column = 0; column < k; column += kGroup)
    with_constant<kGroup>(std::min(kGroup, k - column), [&](auto constant) {
      subtract_columns<decltype(constant)::value>(l + static_cast<long>(column) * ldl, ldl, x + column, y, m);
    });
}

void subtract_transposed(const double* l, int ldl, const double* x, double* y, int m, int k) {
  for (int column = 0; column < k; column += kGroup)
    with_constant<kGroup>(std::min(kGroup, k - column), [&](auto constant) {
      subtract_dots<decltype(constant)::value>(l + static_cast<long>(column) * ldl, ldl, x, y + column, m);
    });
}

void solve_forward(const double* l, int ldl, double* v, int r, int k) {
  for (int column = 0; column < k; column += kGroup) {
    const int columns = std::min(kGroup, k - column), below = column + columns;
    const double* const panel = l + static_cast<long>(column) * ldl;
    for (int c = 0; c < columns; ++c) {
      double& value = v[column + c];
      value /= panel[column + c + static_cast<long>(c) * ldl];
      for (int i = c + 1; i < columns; ++i) v[column + i] -= panel[column + i + static_cast<long>(c) * ldl] * value;
    }
    subtract_multiple(panel + below, ldl, v + column, v + below, r - below, columns);
  }
}

void solve_backward(const double* l, int ldl, double* v, int r, int k) {
  for (int end = k; end > 0;) {
    const int column = (end - 1) / kGroup * kGroup, columns = end - column;
    const double* const panel = l + static_cast<long>(column) * ldl;
    subtract_transposed(panel + end, ldl, v + end, v + column, r - end, columns);
    for (int c = columns - 1; c >= 0; --c) {
      double& value = v[column + c];
      for (int i = c + 1; i < columns; ++i) value -= panel[column + i + static_cast<long>(c) * ldl] * v[column + i];
      value /= panel[column + c + static_cast<long>(c) * ldl];
    }
    end = column;
  }
}

/// to[places[i]] += from[i] for i in [begin, end).
void add_scattered(double* to, const double* from, const int* places, int begin, int end) {
  constexpr int kRun = 8;
  int i = begin;
  for (; i + kRun <= end; i += kRun) {
    double* const at = to + places[i];
    if (places[i + kRun - 1] - places[i] == kRun - 1)
      for (int k = 0; k < kRun; ++k) at[k] += from[i + k];
    else
      for (int k = 0; k < kRun; ++k) to[places[i + k]] += from[i + k];
  }
  for (; i < end; ++i) to[places[i]] += from[i];
}

constexpr DenseKernels kKernels{subtract_product, subtract_square,   divide_by_transposed, factorize_lower, solve_forward,
                                solve_backward,   subtract_multiple, subtract_transposed,  add_scattered};

}  // namespace
}  // namespace itr::backends
