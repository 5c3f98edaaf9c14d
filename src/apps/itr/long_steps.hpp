// SPDX-License-Identifier: MIT
#pragma once

#include <string>
#include <vector>

#include "itr/setup.hpp"

namespace itr::cli {

/// Fastest that anything is driven [m/s]: by what is prescribed, and by gravity over the `size` of the bodies [m].
template <int Dim>
double driven_speed(const Setup<Dim>& setup, double size, const Vec<Dim>& center);

/// Adds a sentence for each time of the scene that the steps are longer than: those in which prescribed values go to and
/// fro, in which bodies cross the scene, and in which held bodies swing.
template <int Dim>
void find_long_steps(const Setup<Dim>& setup, double size, const Vec<Dim>& center, std::vector<std::string>& found);

}  // namespace itr::cli
