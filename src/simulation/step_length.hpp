// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

#include "itr/simulation/setup.hpp"

namespace itr {

/// Fastest that anything is driven [m/s]: at the start, by gravity over the size of the scene, by what is prescribed.
/// `size` [m] of the bodies and a vertex at their `center` [m], where loads are asked for.
template <int Dim>
double driven_speed(const Setup<Dim>& setup, double size, const Vec<Dim>& center);

/// Adds a sentence for each time of the scene that the steps are longer than: those in which prescribed values go to and
/// fro, in which bodies cross the scene, and in which held bodies swing.
template <int Dim>
void find_long_steps(const Setup<Dim>& setup, double size, const Vec<Dim>& center, std::vector<std::string>& found);

}  // namespace itr
