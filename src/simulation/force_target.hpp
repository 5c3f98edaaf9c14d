// SPDX-License-Identifier: MIT
#pragma once

#include <set>
#include <string>

#include "itr/setup.hpp"
#include "simulation/resultant.hpp"

namespace itr {

/// Throws InputError at `place` for a target that names nothing, or a surface, a body or a vertex of an obstacle that is not
/// there. `surfaces`: tags of facets.
template <int Dim>
void refuse_unknown(const ForceTarget& target, const Mesh<Dim>& mesh, const std::set<int>& surfaces,
                    std::size_t obstacle_vertices, const std::string& place);

/// Sums forces like force_sums(), for a target that was checked.
template <int Dim>
ForceSums<Dim> sum_forces(const State<Dim>& state, const NodalForces& forces, const ForceTarget& target);

}  // namespace itr
