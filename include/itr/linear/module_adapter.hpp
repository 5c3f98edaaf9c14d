// SPDX-License-Identifier: MIT
// For those who write a solver module: turns a C++ class into a row of the module's C table. Header-only; a module needs
// nothing else of this library.
//
// An engine is a class with a default constructor and
//   int analyze(const itr_pattern&, int block_size);
//   int factorize(const double* values, size_t count);
//   int solve(const double* rhs, double* solution, int columns);
//   const char* message() const;
// Exceptions must not leave the module: they become ITR_OUT_OF_MEMORY or ITR_FAILED here.
#pragma once

#include <new>

#include "itr/linear/abi.h"

namespace itr::linear {

template <typename Engine>
struct ModuleAdapter {
  template <typename F>
  static int32_t guarded(F&& f) {
    try {
      return f();
    } catch (const std::bad_alloc&) {
      return ITR_OUT_OF_MEMORY;
    } catch (...) {
      return ITR_FAILED;
    }
  }
  static void* create() {
    try {
      return new Engine();
    } catch (...) {
      return nullptr;
    }
  }
  static void destroy(void* self) { delete static_cast<Engine*>(self); }
  static int32_t analyze(void* self, const itr_pattern* pattern, int32_t block_size) {
    return guarded([&] { return static_cast<Engine*>(self)->analyze(*pattern, block_size); });
  }
  static int32_t factorize(void* self, const double* values, size_t count) {
    return guarded([&] { return static_cast<Engine*>(self)->factorize(values, count); });
  }
  static int32_t solve(void* self, const double* rhs, double* solution, int32_t columns) {
    return guarded([&] { return static_cast<Engine*>(self)->solve(rhs, solution, columns); });
  }
  static const char* message(void* self) { return static_cast<Engine*>(self)->message(); }

  static itr_engine row(const char* name, const char* library_version, const char* license, uint32_t capabilities) {
    return {name, library_version, license, capabilities, create, destroy, analyze, factorize, solve, message};
  }
};

}  // namespace itr::linear
