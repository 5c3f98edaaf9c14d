// SPDX-License-Identifier: MIT
#pragma once

#include <functional>
#include <vector>

#include "itr/mesh.hpp"
#include "itr/setup.hpp"
#include "itr/types.hpp"

namespace itr {

/// Contact force on each node of a compact mesh by the present area that it acts on [Pa]; below 0 where it pulls. The area
/// is that of the surface around a vertex as the force sees it, so that corners count the sides that are pressed alone. The
/// force on a curved edge is one of its ends', and its pressure their mean.
template <int Dim>
VectorX contact_pressure(const Mesh<Dim>& mesh, ConstVectorView x, ConstVectorView force);

/// Contact pressure by all contact of a setup. Where it acts on a retracted surface, what nodes inside of a body carry is
/// brought to the vertices of the boundary before them.
template <int Dim>
VectorX contact_pressure(const StepSetup<Dim>& setup, const Mesh<Dim>& mesh, ConstVectorView x, ConstVectorView force);

/// Contact forces on nodes with those inside of bodies brought to the boundary, whose vertices are those of the retracted
/// surface, in their order.
template <int Dim>
VectorX force_on_boundary(const CollisionProxy<Dim>& retracted, const Mesh<Dim>& mesh, ConstVectorView force);

/// Contact force on each facet of a compact mesh by its present area [Pa], 0 where it pulls. The facets around a vertex have
/// parts of its force as above; where some of them `take` it, which pressed facets do at the rim of contact, the others have
/// none of it.
template <int Dim>
std::vector<double> contact_pressure_on_facets(const Mesh<Dim>& mesh, ConstVectorView x, ConstVectorView force,
                                               const std::function<bool(FacetId)>& take);

}  // namespace itr
