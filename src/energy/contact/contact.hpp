// SPDX-License-Identifier: MIT
// Active pairs of the term of itr/contact.hpp, as its workspace keeps them.
#pragma once

#include "energy/contact/surface.hpp"
#include "energy/energy.hpp"
#include "geometry/distance.hpp"
#include "itr/contact.hpp"

namespace itr {

template <int Dim>
struct ContactEnergy<Dim>::Active {
  std::vector<ContactStencil> stencils;
  double least_squared = 0;  ///< smallest squared distance of the pairs nearer than dhat; infinity if there are none
};

}  // namespace itr
