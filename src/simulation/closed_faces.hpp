// SPDX-License-Identifier: MIT
// Which faces are closed, by the steps that Mesh::steps_apart counts.
#pragma once

#include "fem/chord_levels.hpp"
#include "geometry/closed_surface.hpp"
#include "itr/setup.hpp"

namespace itr {

template <int Dim>
struct ContactSurface;

/// Whether a node (a vertex, or that of a curved edge) was closed `age` steps ago.
template <int Dim>
bool is_closed(const Mesh<Dim>& mesh, int node, int age = 0);
template <int Dim>
bool has_closed_faces(const Mesh<Dim>& mesh, int age = 0);

/// ClosedFaces::coincident of a mesh [m].
template <int Dim>
double coincidence(const Mesh<Dim>& mesh);

/// Closes the faces that ties bond, and those of bodies that coincide at rest; does nothing where a proxy touches in their
/// place.
template <int Dim>
void close_coincident_faces(const StepSetup<Dim>& setup, Mesh<Dim>& mesh);

/// Whether ties bond all faces that are closed.
template <int Dim>
bool has_only_tied_faces(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh);

/// At the end of a step, with bodies at x: opens faces that are apart by d-hat, and counts a step for those that were open.
template <int Dim>
void open_faces(const StepSetup<Dim>& setup, const ChordLevels& chords, const VectorX& x, Mesh<Dim>& mesh);

/// How the bodies of `contact` overlap, whose boundary this is, but for facets with vertices that ties may bond.
template <int Dim>
Overlap<Dim> find_overlap(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, const ContactSurface<Dim>& contact,
                          const ClosedSurface<Dim>& boundary);

}  // namespace itr
