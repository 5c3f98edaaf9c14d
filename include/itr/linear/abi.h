/* SPDX-License-Identifier: MIT
 * The boundary between the library and loadable solver modules: plain C, no Eigen types, no exceptions, no virtual tables.
 * A module exports one function, itr_backend_module, that returns its table. Strings belong to the module and live as long
 * as it is loaded. All functions are called by one thread at a time for one instance.
 */
#ifndef ITR_LINEAR_ABI_H
#define ITR_LINEAR_ABI_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define ITR_BACKEND_ABI_VERSION 1
#define ITR_BACKEND_ENTRY "itr_backend_module"

/* Outcomes, as itr::linear::Outcome. */
enum { ITR_OK, ITR_NOT_POSITIVE_DEFINITE, ITR_SINGULAR, ITR_NON_FINITE, ITR_OUT_OF_MEMORY, ITR_NOT_CONVERGED, ITR_FAILED };

/* Capability bits. */
enum { ITR_INDEFINITE = 1, ITR_ITERATIVE = 2, ITR_THREADS = 4, ITR_MPI = 8 };

/* Lower triangle with the diagonal, by columns, rows ascending. */
typedef struct itr_pattern {
  int32_t order;
  const int32_t* column_starts; /* order + 1 */
  const int32_t* row_indices;
} itr_pattern;

typedef struct itr_engine {
  const char* name; /* "cholmod:supernodal" */
  const char* library_version;
  const char* license;
  uint32_t capabilities;
  void* (*create)(void); /* NULL where memory is out */
  void (*destroy)(void* self);
  int32_t (*analyze)(void* self, const itr_pattern* pattern, int32_t block_size);
  int32_t (*factorize)(void* self, const double* values, size_t count);
  /* One right-hand side after another, columns of length `order`. */
  int32_t (*solve)(void* self, const double* rhs, double* solution, int32_t columns);
  const char* (*message)(void* self);
} itr_engine;

typedef struct itr_module {
  uint32_t abi_version; /* must stay the first member */
  int32_t num_engines;
  const itr_engine* engines;
} itr_module;

typedef const itr_module* (*itr_backend_entry)(void);

#ifdef __cplusplus
}
#endif
#endif
