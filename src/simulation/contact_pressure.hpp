// SPDX-License-Identifier: MIT
#pragma once

#include "itr/mesh.hpp"
#include "itr/types.hpp"

namespace itr {

/// Contact force on each node of a compact mesh by the present area that it acts on [Pa]; below 0 where it pulls. The area
/// is that of the surface around a vertex as the force sees it, so that corners count the sides that are pressed alone. The
/// force on a curved edge is one of its ends', and its pressure their mean.
template <int Dim>
VectorX contact_pressure(const Mesh<Dim>& mesh, ConstVectorView x, ConstVectorView force);

}  // namespace itr
