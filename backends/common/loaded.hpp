// SPDX-License-Identifier: MIT
#pragma once

#include <dlfcn.h>

namespace itr::backends {

/// A function of the libraries that this module was loaded with, null where none has it. They are loaded locally, so they
/// are searched from the module; where a program has this code, from the program. Linked against it, a module would not load
/// beside a library that does without.
template <typename Function>
Function* find_loaded(const char* name) {
  Dl_info info{};
  if (!dladdr(reinterpret_cast<void*>(&find_loaded<Function>), &info) || !info.dli_fname) return nullptr;
  void* self = dlopen(info.dli_fname, RTLD_NOW | RTLD_NOLOAD);
  if (!self) self = dlopen(nullptr, RTLD_NOW);
  if (!self) return nullptr;
  auto* function = reinterpret_cast<Function*>(dlsym(self, name));
  dlclose(self);
  return function;
}

}  // namespace itr::backends
