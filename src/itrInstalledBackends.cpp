// SPDX-License-Identifier: MIT
// Compiled into programs that link an installed itr: where the solver modules of its prefix are.
extern "C" const char* itr_installed_backends() { return ITR_INSTALLED_BACKENDS; }
