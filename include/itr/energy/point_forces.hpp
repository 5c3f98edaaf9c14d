// SPDX-License-Identifier: MIT
#pragma once

#include "itr/energy/host_terms.hpp"

namespace itr {

/// Forces [N] on the nodes (vertices, then those of curved edges) of a compact mesh, interleaved, as dead loads at their
/// rest positions: minus the work that they do from rest. They stay at these points of the bodies however the mesh changes:
/// on another mesh the vertices of the cell that a point is in share its force, which keeps resultant and moment. Throws
/// InputError for a wrong length or numbers that are not finite.
template <int Dim>
TermFactory<Dim> point_forces(const Mesh<Dim>& mesh, ConstVectorView forces);

}  // namespace itr
