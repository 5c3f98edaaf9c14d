// SPDX-License-Identifier: MIT
#pragma once

#include "itr/setup.hpp"

namespace itr {

/// Fastest of initial velocities and of what is prescribed in the first `steps` [m/s]. `center` [m]: a vertex at the bodies'
/// centre, where loads are asked for.
template <int Dim>
double prescribed_speed(const Setup<Dim>& setup, const Vec<Dim>& center, int steps);

}  // namespace itr
