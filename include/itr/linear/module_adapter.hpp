// SPDX-License-Identifier: MIT
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
#pragma once

#include <exception>
#include <new>
#include <string>
#include <string_view>

#include "itr/linear/abi.h"

namespace itr::linear {

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

}  // namespace itr::linear
