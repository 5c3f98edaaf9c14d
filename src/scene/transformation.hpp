// SPDX-License-Identifier: MIT
#pragma once

#include <Eigen/Geometry>

#include "itr/types.hpp"
#include "node.hpp"

namespace itr::scene {

template <int Dim>
using Box = Eigen::AlignedBox<double, Dim>;

template <int Dim>
Box<Dim> bounding_box(const std::vector<Vec<Dim>>& points);

/// Applies `advanced/normalize_mesh`, `unit` and `transformation` of a geometry (docs/theory.md, "Meshes"): scale, rotate,
/// translate. Returns whether that turns the orientation round (a mirror).
template <int Dim>
bool transform(std::vector<Vec<Dim>>& points, const Node& geometry);

/// Asks about angles up to a whole turn that are parts of pi: rotations are in degrees.
void warn_of_radians(const Node& transformation, std::vector<std::string>& warnings);

}  // namespace itr::scene
