// SPDX-License-Identifier: MIT
// The built-in solvers.
#pragma once

#include <memory>

#include "itr/solver.hpp"

namespace itr::linear {

std::unique_ptr<Engine> make_eigen_ldlt();
std::unique_ptr<Engine> make_eigen_llt();
std::unique_ptr<Engine> make_eigen_lu();
std::unique_ptr<Engine> make_eigen_cg();
std::unique_ptr<Engine> make_dense();

}  // namespace itr::linear
