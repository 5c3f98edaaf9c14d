/* SPDX-License-Identifier: MIT
 * The boundary between the library and loadable solver modules: plain C, no Eigen types, no exceptions, no virtual tables.
 * A module exports one function, itr_backend_module, that returns its table. Strings belong to the module and live as long
 * as it is loaded. All functions are called by one thread at a time for one instance, by any thread for different ones.
 */
#ifndef ITR_MODULE_H
#define ITR_MODULE_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define ITR_BACKEND_ABI_VERSION 5
#define ITR_BACKEND_ENTRY "itr_backend_module"

/* Names as in C. NOLINTBEGIN(readability-identifier-naming) */

/* Outcomes, as itr::linear::Outcome. */
enum { ITR_OK, ITR_NOT_POSITIVE_DEFINITE, ITR_SINGULAR, ITR_NON_FINITE, ITR_OUT_OF_MEMORY, ITR_NOT_CONVERGED, ITR_FAILED };

/* Capability bits. ITR_TELLS_DEFINITENESS: ITR_NOT_POSITIVE_DEFINITE or negative_pivots tells of every matrix that is not.
 */
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
  /* Of the last factorisation or solve [s], where it was done by tasks on the threads of TBB: by the clock, sum of all
   * tasks, and longest chain of tasks that wait for each other. */
  double tasks_wall, tasks_work, tasks_span;
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
}  // extern "C"

#include <charconv>
#include <exception>
#include <new>
#include <string>
#include <string_view>
#include <system_error>

namespace itr::linear {

// For those who write a solver module: turns a C++ class into a row of the module's C table. Header-only; a module needs
// nothing else of this library.
//
// An engine is a class with a default constructor and
//   int set_option(std::string_view key, std::string_view value);   // ITR_FAILED: no such key or value
//   int analyze(const itr_pattern&, const itr_hints&);
//   int factorize(const double* values, size_t count);
//   int solve(const double* rhs, double* solution, int columns);
//   itr_statistics statistics() const;
//   const char* message() const;
// Exceptions must not leave the module: they become ITR_OUT_OF_MEMORY or ITR_FAILED here, with what() as the message.

template <typename Engine>
class ModuleAdapter {
 public:
  static itr_engine row(const char* name, const char* library_version, const char* license, uint32_t capabilities,
                        const char* options) {
    return {name,      library_version, license,    capabilities, options, create,  destroy, set_option, analyze,
            factorize, solve,           statistics, message,      nullptr, nullptr, nullptr, nullptr};
  }

 private:
  struct Instance {
    Engine engine;
    std::string exception;  ///< text of the last one, empty where the last call had none
  };
  template <typename F>
  static int32_t guarded(void* self, F&& f) {
    auto& [engine, exception] = *static_cast<Instance*>(self);
    try {
      exception.clear();
      return f(engine);
    } catch (const std::bad_alloc&) {
      exception = "out of memory";  // short enough to need none
      return ITR_OUT_OF_MEMORY;
    } catch (const std::exception& error) {
      exception = error.what();
    } catch (...) {
      exception = "an exception of unknown type";
    }
    return ITR_FAILED;
  }
  static void* create() {
    try {
      return new Instance();
    } catch (...) {
      return nullptr;
    }
  }
  static void destroy(void* self) { delete static_cast<Instance*>(self); }
  static int32_t set_option(void* self, const char* key, const char* value) {
    return guarded(self, [&](Engine& engine) { return engine.set_option(key, value); });
  }
  static int32_t analyze(void* self, const itr_pattern* pattern, const itr_hints* hints) {
    return guarded(self, [&](Engine& engine) { return engine.analyze(*pattern, *hints); });
  }
  static int32_t factorize(void* self, const double* values, size_t count) {
    return guarded(self, [&](Engine& engine) { return engine.factorize(values, count); });
  }
  static int32_t solve(void* self, const double* rhs, double* solution, int32_t columns) {
    return guarded(self, [&](Engine& engine) { return engine.solve(rhs, solution, columns); });
  }
  static void statistics(void* self, itr_statistics* out) { *out = static_cast<Instance*>(self)->engine.statistics(); }
  static const char* message(void* self) {
    const auto& [engine, exception] = *static_cast<Instance*>(self);
    return exception.empty() ? engine.message() : exception.c_str();
  }
};

/// The options that iterative solvers share, in the library and in modules (C++17).
struct IterationOptions {
  static constexpr const char* kNames = "tolerance=NUMBER max_iterations=NUMBER";

  double tolerance = 1e-10;  ///< relative residual at which to stop
  int max_iterations = 0;    ///< 0: the solver's own choice

  /// False where there is no such option, or not with that value.
  bool set(std::string_view key, std::string_view value) {
    double number = 0;
    const auto [end, error] = std::from_chars(value.data(), value.data() + value.size(), number);
    if (error != std::errc() || end != value.data() + value.size()) return false;
    if (key == "tolerance" && number > 0 && number < 1)
      tolerance = number;
    else if (key == "max_iterations" && number >= 1 && number < 1e9)
      max_iterations = static_cast<int>(number);
    else
      return false;
    return true;
  }
};

}  // namespace itr::linear
#endif
#endif
