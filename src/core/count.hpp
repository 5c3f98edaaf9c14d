// SPDX-License-Identifier: MIT
#pragma once

#include <cstddef>

namespace itr {

/// A count of entries as an index of 32 bits, which linear solvers take. Throws InputError, `what` being too many, where it
/// is none.
int as_index(std::size_t count, const char* what);

}  // namespace itr
