// SPDX-License-Identifier: MIT
#pragma once

#include "../node.hpp"
#include "itr/setup.hpp"

namespace itr::scene {

/// PolyFEM's use_gcp_formulation: makes contact of a setup that has all but this the geometric contact potential.
template <int Dim>
void read_geometric_contact(const Node& root, Setup<Dim>& setup);

}  // namespace itr::scene
