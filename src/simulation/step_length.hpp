// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

#include "itr/setup.hpp"

namespace itr {

/// Fastest of initial velocities and of what is prescribed in the first `steps` [m/s]. `center` [m]: a vertex at the bodies'
/// centre, where loads are asked for.
template <int Dim>
double prescribed_speed(const Setup<Dim>& setup, const Vec<Dim>& center, int steps);

/// Fastest that anything is driven [m/s]: by what is prescribed, and by gravity over the `size` of the bodies [m].
template <int Dim>
double driven_speed(const Setup<Dim>& setup, double size, const Vec<Dim>& center);

/// Adds a sentence for each time of the scene that the steps are longer than: those in which prescribed values go to and
/// fro, in which bodies cross the scene, and in which held bodies swing.
template <int Dim>
void find_long_steps(const Setup<Dim>& setup, double size, const Vec<Dim>& center, std::vector<std::string>& found);

}  // namespace itr
