// SPDX-License-Identifier: MIT
#pragma once

#include <map>
#include <vector>

#include "itr/contact.hpp"

namespace itr {

/// Directions along which pairs of two coefficients have their first one, where surfaces are at x. Both must outlive this.
class FrictionDirections {
 public:
  FrictionDirections(const CollisionSurface& surface, ConstVectorView x) : surface_(surface), x_(x) {}
  /// Returns the direction for an active pair with these weights of its closest points. `is_first_a`: whether its first
  /// primitive is of side a.
  Vec<3> at(const ContactStencil& pair, const Vec<4>& weights, const FrictionPair& by_direction, bool is_first_a);

 private:
  const CollisionSurface& surface_;
  ConstVectorView x_;
  std::map<const FrictionPair*, std::vector<Vec<3>>> turned_;  ///< by vertex
};

}  // namespace itr
