/* SPDX-License-Identifier: MIT
 * The boundary between the library and loadable solver modules: plain C, no Eigen types, no exceptions, no virtual tables.
 * A module exports one function, itr_backend_module, that returns its table. Strings belong to the module and live as long
 * as it is loaded. All functions are called by one thread at a time for one instance, by any thread for different ones.
 */
#ifndef ITR_LINEAR_ABI_H
#define ITR_LINEAR_ABI_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define ITR_BACKEND_ABI_VERSION 4
#define ITR_BACKEND_ENTRY "itr_backend_module"

/* Names as in C. NOLINTBEGIN(readability-identifier-naming) */

/* Outcomes, as itr::linear::Outcome. */
enum { ITR_OK, ITR_NOT_POSITIVE_DEFINITE, ITR_SINGULAR, ITR_NON_FINITE, ITR_OUT_OF_MEMORY, ITR_NOT_CONVERGED, ITR_FAILED };

/* Capability bits. ITR_TELLS_DEFINITENESS: ITR_NOT_POSITIVE_DEFINITE or negative_pivots tells of every matrix that is not. */
enum {
  ITR_INDEFINITE = 1,
  ITR_ITERATIVE = 2,
  ITR_THREADS = 4,
  ITR_MPI = 8,
  ITR_KEEPS_ORDER = 16,
  ITR_TELLS_DEFINITENESS = 32
};

/* Lower triangle with the diagonal, by columns, rows ascending. */
typedef struct itr_pattern {
  int32_t order;
  const int32_t* column_starts; /* order + 1 */
  const int32_t* row_indices;
} itr_pattern;

/* What may help an analysis. */
typedef struct itr_hints {
  int32_t block_size;        /* unknowns a node where none is held: the dimension; 1: nothing is known */
  const int32_t* dofs;       /* order: block_size * node + component of each unknown, ascending; or NULL */
  const double* coordinates; /* block_size * order: position of each unknown's node [m]; or NULL */
  /* 0: the result must depend on this pattern alone. Else, with ITR_KEEPS_ORDER, the fill-reducing order of an analysis
   * before may serve again. */
  int32_t may_keep_order;
} itr_hints;

/* What the last factorisation and solve took; zero where the library does not tell. */
typedef struct itr_statistics {
  double factor_nonzeros;
  double factor_bytes;    /* summed over the ranks */
  double largest_bytes;   /* of any one rank */
  double flops;           /* of the factorisation */
  double iterations;      /* of the last solve */
  double negative_pivots; /* of the last factorisation L D L^T: as many as negative eigenvalues */
} itr_statistics;

typedef struct itr_engine {
  const char* name; /* "cholmod:supernodal" */
  const char* library_version;
  const char* license;
  uint32_t capabilities;
  const char* options;   /* what set_option takes: "ordering=amd|metis tolerance=NUMBER", separated by spaces; may be "" */
  void* (*create)(void); /* NULL where memory is out */
  void (*destroy)(void* self);
  /* Before analyze. ITR_FAILED for a key or a value that is not in `options`. */
  int32_t (*set_option)(void* self, const char* key, const char* value);
  int32_t (*analyze)(void* self, const itr_pattern* pattern, const itr_hints* hints);
  int32_t (*factorize)(void* self, const double* values, size_t count);
  /* One right-hand side after another, columns of length `order`. */
  int32_t (*solve)(void* self, const double* rhs, double* solution, int32_t columns);
  void (*statistics)(void* self, itr_statistics* out);
  const char* (*message)(void* self);
  /* Only where the library behind runs on MPI, be it on one rank; else NULL. ITR_OK where MPI runs. Where nobody has
   * initialised it: with may_start initialises it, to be finalised at exit, else ITR_FAILED. */
  int32_t (*prepare_mpi)(int32_t may_start);
  /* Only with ITR_MPI, else NULL. `communicator` points to an MPI_Comm of the caller, who has initialised MPI; NULL: the
   * module initialises MPI where nobody has, takes all ranks of the launch, and finalises what it initialised.
   * On rank 0: instances created from now on use all ranks; disconnect lets the others return from serve. Call it after
   * the last instance is gone. */
  int32_t (*connect)(const void* communicator);
  void (*disconnect)(void);
  /* On the other ranks: takes part in rank 0's factorisations until it disconnects. */
  int32_t (*serve)(const void* communicator);
} itr_engine;

typedef struct itr_module {
  uint32_t abi_version; /* must stay the first member */
  int32_t num_engines;
  const itr_engine* engines;
} itr_module;

typedef const itr_module* (*itr_backend_entry)(void);

/* NOLINTEND(readability-identifier-naming) */

#ifdef __cplusplus
}
#endif
#endif
