// SPDX-License-Identifier: MIT
// Pairs of the contact barrier, for the term itr/contact.hpp.
#pragma once

#include "energy/contact/surface.hpp"
#include "energy/energy.hpp"
#include "energy/step_limit.hpp"
#include "geometry/distance.hpp"
#include "itr/contact.hpp"

namespace itr {

/// An active pair of primitives, reduced to its closest features. Nearly parallel edges stay edges.
struct ContactStencil {
  PairKind kind = PairKind::vertex_vertex;
  std::array<int, 4> vertices{kNone, kNone, kNone, kNone};
  double weight = 0;  ///< area weights and corrections included; may be negative
  /// For nearly parallel edges: |u x v|^2 below which the pair fades out [m^4], and the features whose distance counts.
  double mollifier_threshold = 0;
  ClosestFeatures closest{};

  int size() const { return pair_size(kind); }
  bool is_mollified() const { return mollifier_threshold > 0; }
};

template <int Dim>
struct ContactEnergy<Dim>::Active {
  std::vector<ContactStencil> stencils;
  double least_squared = 0;  ///< smallest squared distance of the pairs nearer than dhat; infinity if there are none
};

}  // namespace itr
