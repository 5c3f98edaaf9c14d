// SPDX-License-Identifier: MIT
#pragma once

#include "loaded.hpp"

namespace itr::backends {

/// While it lives, parallel regions that the calling thread enters run on that thread alone. For libraries whose regions ask
/// for a number of threads of their own: CHOLMOD of SuiteSparse 5 always takes four, for copies so short that waking the
/// threads costs more than the factorisation. OpenMP has no other switch against such a number once the program runs.
class OneOpenMpThread {
 public:
  OneOpenMpThread() : levels_(runtime().get ? runtime().get() : 0) {
    if (runtime().get) runtime().set(0);
  }
  ~OneOpenMpThread() {
    if (runtime().get) runtime().set(levels_);
  }
  OneOpenMpThread(const OneOpenMpThread&) = delete;
  OneOpenMpThread& operator=(const OneOpenMpThread&) = delete;

 private:
  struct Runtime {
    int (*get)() = nullptr;
    void (*set)(int) = nullptr;
  };
  /// Runtime of the module's own libraries; null where they do without OpenMP.
  static const Runtime& runtime() {
    static const Runtime found = [] {
      const Runtime both{find_loaded<int()>("omp_get_max_active_levels"),
                         find_loaded<void(int)>("omp_set_max_active_levels")};
      return both.set ? both : Runtime{};
    }();
    return found;
  }
  int levels_;
};

}  // namespace itr::backends
