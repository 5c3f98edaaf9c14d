// SPDX-License-Identifier: MIT
// Values of a scene that Python computes: {"file_name": "bc.py", "function_name": "left"}.
#pragma once

#include <functional>

#include "../node.hpp"

namespace itr::scene {

bool is_python_value(const Json& json);

/// The function of the file, f(x, y, z, t) or f(x, y, z, t, index) with an index of 0, in the units of the scene. Python
/// runs in a process of its own, one for each file, which several threads may ask. Throws InputError at the value: there is
/// no such file, no python3 on the path, no such function, or what it raises.
std::function<double(double x, double y, double z, double t)> read_python_value(const Node& node);

}  // namespace itr::scene
