// SPDX-License-Identifier: MIT
// One thread for the BLAS that a module was loaded with, whatever the environment says: results do not depend on it, and
// our own threads do not compete with BLAS's.
#pragma once

#include <algorithm>
#include <cstdio>
#include <string_view>

#include "loaded.hpp"

namespace itr::backends {

/// Pins OpenBLAS to one thread; returns what BLAS this is. Call it once, when the module is loaded.
inline const char* pin_blas() {
  static char text[96] = "reference BLAS (install libopenblas-dev: it is much faster)";
  if (auto* set_threads = find_loaded<void(int)>("openblas_set_num_threads")) {
    set_threads(1);
    // "OpenBLAS 0.3.21 NO_LAPACKE ...": the name and the version.
    const auto config = find_loaded<char*()>("openblas_get_config");
    const std::string_view words = config ? config() : "OpenBLAS";
    const auto end = words.find(' ', words.find(' ') + 1);
    std::snprintf(text, sizeof text, "%.*s", static_cast<int>(std::min(end, words.size())), words.data());
  }
  return text;
}

}  // namespace itr::backends
