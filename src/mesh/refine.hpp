// SPDX-License-Identifier: MIT
#pragma once

#include "itr/mesh.hpp"

namespace itr {

/// Splits each cell at its edge midpoints: a triangle into 4, a tetrahedron into 8 (inner octahedron around the diagonal
/// that joins the midpoints of edges (0,1) and (2,3) of its vertices in ascending order). Body ids and tags pass on.
/// Old vertices keep their ids; midpoints follow, in the ascending order of their edges.
template <int Dim>
Mesh<Dim> refine_uniformly(const Mesh<Dim>& mesh);

}  // namespace itr
