// SPDX-License-Identifier: MIT
// `geometry/rigid`: bodies that do not deform (docs/theory.md, "Rigid bodies").
#pragma once

#include <array>
#include <functional>
#include <map>
#include <set>

#include "itr/setup.hpp"
#include "mesh/mesh_file.hpp"
#include "node.hpp"
#include "sets.hpp"

namespace itr::scene {

/// The label that the cells of a rigid geometry have and no others.
Label rigid_label(const Node& geometry);
/// Whether it is enabled and rigid.
bool is_rigid(const Node& geometry);
/// The ids of all rigid bodies.
std::set<int> rigid_ids(const Node& root, const LabelIds& bodies);

/// The tetrahedra between a closed surface and its centroid, for a rigid body that has a surface alone. InputError where not
/// all of the surface is seen from there.
MeshFile filled_surface(const Node& geometry, const MeshFile& surface);

/// Reads names of held components: x, y, z, rx, ry, rz.
void read_held(const Node& node, int dim, std::array<bool, 3>& position, std::array<bool, 3>& rotation);
using FunctionOfTime = std::function<Vec<3>(double t)>;
/// A vector of one expression a component, of the time and the point `about`; empty where it is absent or 0.
template <int Dim>
FunctionOfTime read_vector(const Node& node, const TimeOptions& time, const Vec<3>& about);
/// A moment or turn likewise; in a plane one number or expression, about z.
FunctionOfTime read_axial_vector(const Node& node, int dim, const TimeOptions& time, const Vec<3>& about);

/// Adds the materials of the rigid bodies to a setup whose mesh, time and other materials are read.
template <int Dim>
void read_rigid_bodies(const Node& root, const LabelIds& bodies, Setup<Dim>& setup);

}  // namespace itr::scene
