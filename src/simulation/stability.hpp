// SPDX-License-Identifier: MIT
// Whether a static solution is stable only because straight edges cannot follow the way in which it would buckle.
#pragma once

#include <vector>

#include "simulation/step.hpp"

namespace itr {

/// Edges that have to become curved so that the mesh can follow a way on which the energy at x has negative curvature in the
/// space with all edges curved; none where there is no such way. Looks where slender bodies are compressed, in statics with
/// remeshing, and nowhere else.
template <int Dim>
std::vector<EdgeKey> find_edges_that_lock(const StepTools<Dim>& tools, const State<Dim>& state, const VectorX& x);

}  // namespace itr
